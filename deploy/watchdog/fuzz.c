/* Throws anything at the watchdog, mostly with a right MAC, and holds its laws. For a fuzzer:
 *
 *   clang -g -O1 -fsanitize=fuzzer,address,undefined -DLIBFUZZER fuzz.c watchdog.c blink.c health.c tool.c attitude.c hmac.c -lm
 *
 * or alone, with numbers of its own, for so many executions from a seed:
 *
 *   gcc -g -O1 -fsanitize=address,undefined -o fuzz fuzz.c watchdog.c blink.c health.c tool.c attitude.c hmac.c -lm
 *   ./fuzz 1000000 1
 */
#include "blink.h"
#include "bytes.h"
#include "health.h"
#include "tool.h"
#include "watchdog.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#ifndef N
#define N 3 /* thrusters */
#endif
#define F_MAX 3.0
#define COMMAND_BYTES (36u + 4u * N)

static const uint8_t KEY[LL_KEY_BYTES] = {1, 2, 3};
static const ll_attitude_gains GAINS = {
    {1.0, 1.0, 1.0}, {0.3, 0.3, 0.4}, {{1, 2, 3, 4, 5, 6}, {-1, -2, 3, -4, 5, -6}, {0, 0, -6, 0, -10, 0}}};

static void demand(int holds, const char *law)
{
    if (holds)
        return;
    fprintf(stderr, "broken: %s\n", law);
    abort();
}

static void put(uint8_t *p, uint64_t value, int bytes)
{
    for (int i = 0; i < bytes; i++)
        p[i] = (uint8_t)(value >> (8 * i));
}

/* Signs a datagram, now and then one with another byte within `reach` or of another length, or signs
 * it wrongly; gives its length with the MAC. */
static size_t seal(const ll_watchdog *w, const uint8_t *in, uint8_t *data, size_t length, size_t reach)
{
    uint8_t digest[LL_DIGEST_BYTES];
    if (in[7] == 254)
        data[in[5] % reach] ^= in[6];
    if (in[7] == 253)
        length = in[5] % (LL_MAX_BYTES - LL_MAC_BYTES);
    ll_hmac_of(&w->hmac, data, length, digest);
    memcpy(data + length, digest, LL_MAC_BYTES);
    if (in[7] == 252)
        data[length] ^= 1;
    return length + LL_MAC_BYTES;
}

/* The same 8 bytes as a blink order: whatever is in it, the watchdog stays as it is. */
static void blink(const ll_watchdog *w, const uint8_t *in, int64_t now_us, uint64_t nonce)
{
    static ll_blink b;
    uint8_t data[LL_MAX_BYTES] = {0};
    memcpy(data, "LLbl\1", 5);
    put(data + 6, in[1] & 7 ? 62 : in[2], 2);
    put(data + 8, in[2] & 3 ? w->newest_epoch : in[5], 8);
    put(data + 16, in[3] & 7 ? nonce : nonce - in[3], 8);
    put(data + 24, (uint64_t)now_us - (in[4] & 1 ? 1000u * in[5] : 0), 8);
    put(data + 32, in[6] & 1 ? 500 : in[7] << 8, 4);
    memcpy(data + 36, in, LL_BLINK_SLOTS);
    size_t length = seal(w, in, data, 36 + LL_BLINK_SLOTS, 36 + LL_BLINK_SLOTS);
    ll_watchdog before = *w;
    bool taken = ll_blink_receive(&b, w, data, length, now_us);
    demand(memcmp(&before, w, sizeof before) == 0, "a blink order moves nothing");
    demand(!taken || in[7] != 252, "a blink order with a wrong MAC is refused");
    demand(!taken || read_u64(data + 8) == w->newest_epoch, "only who is heard may say blink");
    int dark = ll_blink_dark(&b, now_us);
    demand(dark == LL_NO_LED || (dark >= 0 && dark < 255), "one LED is dark at most");
    demand(ll_blink_dark(&b, now_us + 10000000) == LL_NO_LED || b.begin_us > now_us,
           "after ten seconds all LEDs shine");
}

/* The same 8 bytes as an order for its tool. */
static void tool(const ll_watchdog *w, const uint8_t *in, int64_t now_us, uint64_t nonce)
{
    static ll_tool t = {0, LL_TOOL_STAYS};
    uint8_t data[LL_MAX_BYTES] = {0};
    memcpy(data, "LLtl\1", 5);
    put(data + 6, in[1] & 7 ? 40u * in[2] : 256u * in[2], 2);
    put(data + 8, in[2] & 3 ? w->newest_epoch : in[5], 8);
    put(data + 16, in[3] & 7 ? nonce : nonce - in[3], 8);
    size_t length = seal(w, in, data, 24, 24);
    ll_watchdog before = *w;
    bool taken = ll_tool_receive(&t, w, data, length, now_us);
    demand(memcmp(&before, w, sizeof before) == 0, "an order for its tool moves nothing else");
    demand(!taken || in[7] != 252, "an order for its tool with a wrong MAC is refused");
    demand(!taken || read_u64(data + 8) == w->newest_epoch, "only who is heard may move its tool");
    int wanted = ll_tool_wanted(&t, w, now_us);
    demand(wanted >= LL_TOOL_STAYS && wanted <= LL_TOOL_OPEN, "a tool is open by 0 to all");
    demand(wanted == LL_TOOL_STAYS || w->state == LL_IDLE || w->state == LL_RUNNING,
           "the tool of a robot that does not follow stays");
    demand(ll_tool_wanted(&t, w, now_us + LL_TOOL_LASTS_US) == LL_TOOL_STAYS || t.told_us > now_us,
           "a tool that hears no more stays");
}

/* The same 8 bytes as what it measures of itself: nothing moves by telling it. */
static void health(const ll_watchdog *w, ll_health *h, const uint8_t *in, int64_t now_us)
{
    uint8_t out[LL_HEALTH_BYTES];
    float volts = NAN;
    if (in[5] & 1)
        memcpy(&volts, in, sizeof volts);
    ll_watchdog before = *w;
    bool told = h->tells;
    bool news = h->e_stop != w->e_stop;
    int64_t since_us = now_us - h->told_us;
    size_t size = ll_health_due(h, w, volts, now_us, out);
    demand(memcmp(&before, w, sizeof before) == 0, "telling of its health moves nothing");
    demand(size == 0 || size == LL_HEALTH_BYTES, "health has its size");
    demand((size > 0) == (h->tells && (news || since_us >= LL_HEALTH_EVERY_US)),
           "health is told five times a second, and an emergency stop at once");
    demand(told || h->tells == (!isnan(volts) || w->e_stop != LL_NOT_WIRED), "who knows nothing says nothing");
}

/* One step of 8 bytes: what happens, how much time passes, what is in the datagram. */
static void step(ll_watchdog *w, ll_health *h, const uint8_t *in, int64_t *now_us, uint64_t *nonce)
{
    static const int64_t PASSES[8] = {5000, 5000, 5000, 0, 41000, 61000, 300000, 3000000};
    uint8_t data[LL_MAX_BYTES + 1] = {0}, out[LL_MAX_BYTES];
    float thrusts[N], gyro[3], acc[3];
    *now_us += in[6] == 254 ? -20000 : PASSES[in[0] & 7];
    for (int i = 0; i < 3; i++) {
        gyro[i] = (float)(int8_t)in[5 + i % 3] / 8.0f;
        acc[i] = (float)(int8_t)in[5 + (i + 1) % 3];
    }
    if (in[6] == 253) /* a broken sensor */
        gyro[in[5] % 3] = in[7] & 1 ? NAN : INFINITY;
    if (in[6] == 252)
        acc[in[5] % 3] = in[7] & 1 ? NAN : -INFINITY;
    bool pressed = in[6] == 251 || (w->e_stop == LL_OPEN && in[6] % 8 != 0);
    if (pressed || w->e_stop != LL_NOT_WIRED)
        ll_wire(w, pressed);
    ll_setpoint(w, *now_us, thrusts);
    size_t size = ll_sample(w, *now_us, ++*nonce, gyro, acc, thrusts, out);
    demand(size == 92 + 4 * N, "a sample has its size");
    blink(w, in, *now_us, *nonce);
    tool(w, in, *now_us, *nonce);
    health(w, h, in, *now_us);
    memcpy(data, "LLcm\2", 5);
    data[5] = (in[1] & 31) == 31 ? in[2] : N;
    data[6] = in[1] >> 5 & 3;
    put(data + 8, (uint64_t)(in[2] & 3) + (in[0] >> 7 ? w->epoch : 0), 8);
    put(data + 16, in[3] & 7 ? *nonce : *nonce - in[3], 8);
    put(data + 32, (in[4] & 15 ? (uint64_t)w->counter + 1 : in[5]), 4);
    for (int i = 0; i < N; i++) {
        float thrust = in[4] >> 7 ? (float)in[5 + i % 3] / 80.0f : 0.0f;
        memcpy(data + 36 + 4 * i, &thrust, 4);
        if (in[6] == 255)
            memset(data + 36 + 4 * i, in[7], 4);
    }
    size_t length = seal(w, in, data, COMMAND_BYTES, LL_MAX_BYTES);
    bool answer;
    ll_state before = w->state;
    float given = 0.0f, now = 0.0f;
    for (int i = 0; i < N; i++)
        given += thrusts[i];
    ll_refusal why = ll_receive(w, data, length, *now_us, &answer);
    demand(in[7] != 252 || why == LL_MALFORMED, "a wrong MAC is refused");
    ll_setpoint(w, *now_us, thrusts);
    for (int i = 0; i < N; i++) {
        demand(isfinite(thrusts[i]) && thrusts[i] >= 0.0f && thrusts[i] <= F_MAX * 1.00001,
               "thrusts are finite and within their limits");
        now += thrusts[i];
    }
    demand(now == 0.0f || w->state != LL_REFUSING, "who refuses gives nothing");
    demand(now == 0.0f || w->state != LL_STOPPED_BY_WIRE, "who is stopped by wire gives nothing");
    demand(!pressed || (w->state == LL_STOPPED_BY_WIRE && why != LL_NONE),
           "while the emergency stop is pressed nothing is taken");
    demand(before != LL_STOPPED_BY_WIRE || w->state == before || w->state == LL_REFUSING,
           "out of a stop by wire by a handshake alone");
    demand(now <= given * 1.00001f + 1e-6f || why == LL_NONE, "only what is taken adds thrust");
    demand(now == 0.0f || (before != LL_REFUSING && before != LL_STOPPED_BY_WIRE),
           "no thrust without a handshake");
}

#ifdef LIBFUZZER
static int run(const uint8_t *data, size_t size, bool flies)
{
    ll_limits limits = {N, F_MAX, 1.0, 2000000, flies ? &GAINS : NULL};
    ll_watchdog w;
    ll_health h;
    int64_t now_us = 1000000;
    uint64_t nonce = 1000;
    ll_health_init(&h);
    demand(ll_init(&w, &limits, 7, KEY), "good limits are taken");
    for (; size >= 8; size -= 8, data += 8)
        step(&w, &h, data, &now_us, &nonce);
    return 0;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);
int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    return size ? run(data + 1, size - 1, data[0] & 1) : 0;
}
#else
/* Whole flights: zeros until it is ready, thrust, holes; and everything else, now and then. */
static void draw(uint8_t in[8], uint64_t *state, unsigned wildness)
{
    for (int i = 0; i < 8; i++) {
        *state ^= *state << 13;
        *state ^= *state >> 7;
        *state ^= *state << 17;
        in[i] = (uint8_t)(*state >> 32);
    }
    if (in[0] % 64 >= wildness) { /* a good command */
        in[0] = 0x80;
        in[1] = 0x20;
        in[3] = 1;
        in[4] = (uint8_t)(in[4] | 1);
        in[6] = in[6] % 128 ? 0 : 255; /* rarely not a number */
        in[7] = in[6] ? 255 : in[7] & 0x7f;
    }
}

int main(int argc, char **argv)
{
    if (argc != 3) {
        fprintf(stderr, "usage: %s EXECUTIONS SEED\n", argv[0]);
        return 2;
    }
    long executions = atol(argv[1]), reached[6] = {0};
    uint64_t state = 88172645463325252u + (uint64_t)atol(argv[2]);
    for (long done = 0; done < executions;) {
        ll_limits limits = {N, F_MAX, 1.0, 2000000, done & 1 ? &GAINS : NULL};
        ll_watchdog w;
        ll_health h;
        int64_t now_us = 1000000;
        uint64_t nonce = 1000;
        unsigned wildness = (unsigned)(state % 12);
        ll_health_init(&h);
        demand(ll_init(&w, &limits, 7, KEY), "good limits are taken");
        for (int k = 0; k < 999; k++, done++) {
            uint8_t in[8];
            draw(in, &state, wildness);
            if (w.state == LL_REFUSING || w.state == LL_STOPPED_BY_WIRE) {
                in[4] &= 0x7f; /* zero first, */
                in[2] = 1;     /* of a later epoch */
                if (w.candidate)
                    in[2] = (uint8_t)(w.candidate - w.epoch);
            } else if (in[0] == 0x80) {
                in[2] = 0;
            }
            if (w.candidate && in[0] == 0x80) {
                uint32_t saved = w.counter;
                w.counter = w.candidate_counter;
                step(&w, &h, in, &now_us, &nonce);
                if (w.candidate)
                    w.counter = saved;
            } else {
                step(&w, &h, in, &now_us, &nonce);
            }
            reached[w.state]++;
        }
    }
    printf("%ld executions: IDLE %ld, RUNNING %ld, RAMP %ld, REFUSING %ld, COAST %ld, STOPPED BY WIRE %ld\n",
           executions, reached[0], reached[1], reached[2], reached[3], reached[4], reached[5]);
    for (int i = 0; i < 6; i++)
        if (reached[i] == 0)
            return 1;
    return 0;
}
#endif
