#include "watchdog.h"

#include "bytes.h"

#include <math.h>
#include <string.h>

#define ROUNDING (1.0 + 1e-6) /* thrusts travel as 32-bit floats */
#define MAX_SAMPLE_S 0.05 /* more between two samples is a hole, not a motion */
#define COMMAND_BYTES (36u + LL_MAC_BYTES) /* without thrusts */

typedef struct {
    bool armed, stop, zero;
    uint64_t epoch, nonce, challenge;
    uint32_t counter;
    uint8_t thrusters;
    float thrusts[LL_MAX_THRUSTERS];
} command;

static float read_f32(const uint8_t *p)
{
    uint32_t bits = read_u32(p);
    float value;
    memcpy(&value, &bits, sizeof value);
    return value;
}

static bool any(const float *thrusts, int n)
{
    for (int i = 0; i < n; i++)
        if (thrusts[i] != 0.0f)
            return true;
    return false;
}

/* Counters go round the corner of 32 bits. */
static bool is_later(uint32_t a, uint32_t b)
{
    return a != b && a - b < 0x80000000u;
}

static bool decode(const ll_watchdog *w, const uint8_t *data, size_t size, command *c)
{
    if (size <= COMMAND_BYTES || memcmp(data, "LLcm\2", 5) != 0)
        return false;
    c->thrusters = data[5];
    if (c->thrusters > LL_MAX_THRUSTERS || size != COMMAND_BYTES + 4u * c->thrusters)
        return false;
    size -= LL_MAC_BYTES;
    if (!ll_hmac_fits(&w->hmac, data, size, data + size) || data[6] > 3 || data[7] != 0)
        return false;
    c->armed = data[6] & 1;
    c->stop = data[6] >> 1;
    c->epoch = read_u64(data + 8);
    c->nonce = read_u64(data + 16);
    c->challenge = read_u64(data + 24);
    c->counter = read_u32(data + 32);
    for (int i = 0; i < c->thrusters; i++)
        c->thrusts[i] = read_f32(data + 36 + 4 * i);
    c->zero = !any(c->thrusts, c->thrusters);
    return true;
}

static bool gives(const ll_watchdog *w)
{
    for (int i = 0; i < w->limits.thrusters; i++)
        if (w->base[i] != 0.0)
            return true;
    return false;
}

/* What to give now; in silence the mean of what was given lately, faded, and upright if the robot flies:
 * the last one may be the whole force that was to end a fast motion. */
static void given(const ll_watchdog *w, int64_t now_us, double *thrusts)
{
    if (!w->fading) {
        memcpy(thrusts, w->base, w->limits.thrusters * sizeof *thrusts);
        return;
    }
    double elapsed_us = fmax(0.0, (double)(now_us - w->fading_us));
    double share = fmax(0.0, 1.0 - elapsed_us / (double)w->limits.ramp_us);
    double last = fmax(0.0, 1.0 - elapsed_us / (double)LL_TO_MEAN_US);
    for (int i = 0; i < w->limits.thrusters; i++)
        thrusts[i] = share * (w->mean[i] + last * (w->base[i] - w->mean[i]));
    if (w->limits.attitude)
        ll_attitude_thrusts(&w->attitude, w->limits.attitude, w->limits.thrusters,
                            w->limits.f_max, thrusts);
}

static void fade(ll_watchdog *w, int64_t since_us)
{
    if (!w->fading)
        w->fading_us = since_us;
    w->fading = true;
}

/* Give what is commanded; after a silence, go there by steps of the rise allowed. */
static void follow(ll_watchdog *w, const command *c, int64_t now_us)
{
    if (w->fading) {
        given(w, now_us, w->base);
        w->catching_up = true;
        w->fading = false;
    }
    bool there = true;
    for (int i = 0; i < c->thrusters; i++) {
        double thrust = c->thrusts[i], near = w->limits.max_rise;
        if (w->catching_up && !c->zero)
            thrust = fmin(fmax(thrust, w->base[i] - near), w->base[i] + near);
        there = there && thrust == c->thrusts[i];
        w->base[i] = thrust;
        w->commanded[i] = c->thrusts[i];
    }
    w->catching_up = w->catching_up && !there;
    w->averaged = c->zero ? 0 : w->averaged < LL_MEAN_OF ? w->averaged + 1 : LL_MEAN_OF;
    for (int i = 0; i < c->thrusters; i++)
        w->mean[i] = c->zero ? 0.0 : w->mean[i] + (w->base[i] - w->mean[i]) / w->averaged;
}

static void to_zero(ll_watchdog *w)
{
    memset(w->base, 0, sizeof w->base);
    memset(w->commanded, 0, sizeof w->commanded);
    memset(w->mean, 0, sizeof w->mean);
    w->averaged = 0;
    w->fading = w->catching_up = false;
}

/* At once; a handshake goes on. */
static void refuse(ll_watchdog *w)
{
    w->state = LL_REFUSING;
    w->refusal = LL_SILENT;
    to_zero(w);
}

/* Ramp down, or go on to; at once if there is no thrust. */
static void leave(ll_watchdog *w, int64_t now_us)
{
    if (!gives(w)) {
        refuse(w);
        return;
    }
    w->state = LL_RAMP;
    w->refusal = LL_SILENT;
    fade(w, now_us);
}

/* Let time do its work: silence, ramp, abandoned handshakes. */
static void advance(ll_watchdog *w, int64_t now_us)
{
    int64_t silence_us = now_us - w->taken_us;
    if (w->candidate && now_us - w->shaken_us > LL_SILENCE_US) {
        w->candidate = 0;
        w->refusal = LL_SILENT;
    }
    if ((w->state == LL_IDLE || w->state == LL_RUNNING) && silence_us > LL_SILENCE_US) {
        w->state = LL_COAST;
        w->refusal = LL_SILENT;
        fade(w, w->taken_us + LL_SILENCE_US);
    }
    if (w->state == LL_COAST && silence_us > (gives(w) ? LL_RAMP_AFTER_US : LL_BACK_UNTIL_US))
        leave(w, now_us);
    if (w->state == LL_RAMP && now_us - w->fading_us >= w->limits.ramp_us)
        refuse(w);
}

/* Whether nothing newer was heard before; if so, remember it, and echo its challenge. */
static bool note(ll_watchdog *w, const command *c)
{
    if (c->epoch < w->newest_epoch ||
        (c->epoch == w->newest_epoch && !is_later(c->counter, w->newest_counter)))
        return false;
    w->newest_epoch = c->epoch;
    w->newest_counter = c->counter;
    w->challenge = c->challenge;
    return true;
}

static ll_refusal judge_nonce(const ll_watchdog *w, uint64_t nonce, int64_t now_us)
{
    for (int i = 0; nonce != 0 && i < LL_NONCES; i++)
        if (w->nonces[i].nonce == nonce)
            return now_us - w->nonces[i].sent_us > LL_MAX_AGE_US ? LL_STALE : LL_NONE;
    return LL_NONCE;
}

/* Without thrust until a handshake. */
static bool is_stopped(const ll_watchdog *w)
{
    return w->state == LL_REFUSING || w->state == LL_STOPPED_BY_WIRE;
}

static ll_refusal judge_thrusts(const ll_watchdog *w, const command *c, int64_t now_us)
{
    bool refusing = is_stopped(w), rises = false, beyond = false;
    bool shaking = w->candidate != 0 && c->epoch == w->candidate;
    if (!c->zero && (shaking || (refusing && c->epoch > w->epoch)))
        return LL_ZERO_FIRST;
    if (!shaking && (refusing || c->epoch != w->epoch))
        return LL_EPOCH;
    uint32_t before = shaking ? w->candidate_counter : w->counter, ahead = c->counter - before;
    if (!is_later(c->counter, before) || (!c->zero && ahead > LL_MAX_JUMP))
        return LL_COUNTER;
    for (int i = 0; i < c->thrusters; i++) {
        double thrust = c->thrusts[i], allowed = w->commanded[i] + ahead * w->limits.max_rise;
        beyond = beyond || thrust < 0.0 || thrust > w->limits.f_max * ROUNDING;
        rises = rises || thrust > allowed * ROUNDING;
    }
    if (beyond || (!c->zero && (c->stop || !c->armed)))
        return LL_LIMITS;
    bool back = !w->replaced && now_us - w->taken_us <= LL_BACK_UNTIL_US;
    if (!c->zero && w->state == LL_RAMP && !back)
        return LL_SILENT;
    return rises ? LL_RISE : LL_NONE;
}

static ll_refusal judge(const ll_watchdog *w, const command *c, int64_t now_us)
{
    if (c->thrusters != w->limits.thrusters)
        return LL_THRUSTERS;
    ll_refusal why = judge_nonce(w, c->nonce, now_us);
    if (why != LL_NONE)
        return why;
    for (int i = 0; i < c->thrusters; i++)
        if (!isfinite(c->thrusts[i]))
            return LL_NOT_FINITE;
    if (w->e_stop == LL_OPEN)
        return LL_WIRE;
    if (c->zero && c->epoch > w->epoch && c->epoch > w->candidate)
        return LL_NONE; /* newer than who flies and who is in his handshake */
    return judge_thrusts(w, c, now_us);
}

/* Zero of a later epoch: it gets the robot when thrust is zero and time enough is over. */
static void shake_hands(ll_watchdog *w, const command *c, int64_t now_us)
{
    w->replaced = true;
    leave(w, now_us);
    if (c->stop)
        refuse(w);
    if (c->epoch != w->candidate) {
        w->candidate = c->epoch;
        w->handshake_us = now_us;
    }
    w->candidate_counter = c->counter;
    w->shaken_us = now_us;
    w->refusal = LL_HANDSHAKE;
    if (w->state == LL_REFUSING && now_us - w->handshake_us >= LL_HANDSHAKE_US) {
        w->epoch = c->epoch;
        w->counter = c->counter;
        w->candidate = 0;
        w->state = LL_IDLE;
        w->refusal = LL_NONE;
        w->taken_us = now_us;
        w->replaced = false;
    }
}

static void take(ll_watchdog *w, const command *c, int64_t now_us)
{
    if (c->epoch != w->epoch) {
        shake_hands(w, c, now_us);
        return;
    }
    w->taken_us = now_us;
    w->counter = c->counter;
    if (w->state == LL_RAMP && c->zero) {
        refuse(w);
        return;
    }
    follow(w, c, now_us);
    w->state = c->zero ? LL_IDLE : LL_RUNNING;
    w->refusal = LL_NONE;
}

/* Zero without a fresh nonce: it keeps nothing alive, but it is zero. */
static void obey_zero(ll_watchdog *w, const command *c, bool newest)
{
    if (!c->zero || is_stopped(w))
        return;
    if (c->epoch > w->epoch) {
        if (c->stop && newest)
            refuse(w);
    } else if (c->epoch == w->epoch && is_later(c->counter, w->counter)) {
        w->counter = c->counter;
        if (w->state == LL_RAMP)
            refuse(w);
        to_zero(w);
        if (w->state == LL_RUNNING)
            w->state = LL_IDLE;
    }
}

static bool is_above_zero(double value)
{
    return isfinite(value) && value > 0.0;
}

bool ll_init(ll_watchdog *w, const ll_limits *limits, uint32_t boot_id,
             const uint8_t key[LL_KEY_BYTES])
{
    memset(w, 0, sizeof *w);
    w->boot_id = boot_id;
    w->state = LL_REFUSING;
    w->refusal = LL_STARTED;
    ll_hmac_init(&w->hmac, key, LL_KEY_BYTES);
    ll_attitude_init(&w->attitude);
    if (limits->thrusters < 1 || limits->thrusters > LL_MAX_THRUSTERS || limits->ramp_us <= 0 ||
        !is_above_zero(limits->f_max) || !is_above_zero(limits->max_rise))
        return false; /* no thrusters: no command fits */
    w->limits = *limits;
    return true;
}

ll_refusal ll_receive(ll_watchdog *w, const uint8_t *data, size_t size, int64_t now_us,
                      bool *answer)
{
    command c;
    *answer = false;
    if (!decode(w, data, size, &c))
        return LL_MALFORMED;
    advance(w, now_us);
    *answer = note(w, &c);
    ll_refusal why = judge(w, &c, now_us);
    if (why == LL_NONE) {
        take(w, &c, now_us);
    } else if (w->state != LL_RAMP && w->state != LL_STOPPED_BY_WIRE) {
        w->refusal = why;
        if (why == LL_ZERO_FIRST)
            w->candidate = 0;
    }
    if (why == LL_NONCE || why == LL_STALE)
        obey_zero(w, &c, *answer);
    return why;
}

bool ll_hears(const ll_watchdog *w, uint64_t epoch, uint64_t nonce, int64_t now_us)
{
    return epoch == w->newest_epoch && judge_nonce(w, nonce, now_us) == LL_NONE;
}

void ll_setpoint(ll_watchdog *w, int64_t now_us, float *thrusts)
{
    double now[LL_MAX_THRUSTERS];
    advance(w, now_us);
    given(w, now_us, now);
    for (int i = 0; i < w->limits.thrusters; i++)
        thrusts[i] = (float)now[i];
}

size_t ll_sample(ll_watchdog *w, int64_t now_us, uint64_t nonce, const float gyro[3],
                 const float accelerometer[3], const float *thrusts, uint8_t out[LL_MAX_BYTES])
{
    size_t n = w->limits.thrusters, size = 76 + 4 * n;
    uint8_t digest[LL_DIGEST_BYTES];
    advance(w, now_us);
    if (w->limits.attitude) {
        double h = fmax(0.0, fmin(MAX_SAMPLE_S, 1e-6 * (double)(now_us - w->sampled_us)));
        ll_attitude_add_imu(&w->attitude, gyro, accelerometer, h, !gives(w));
    }
    w->sampled_us = now_us;
    w->samples++;
    w->nonces[w->samples % LL_NONCES].nonce = nonce;
    w->nonces[w->samples % LL_NONCES].sent_us = now_us;
    memcpy(out, "LLsm\2", 5);
    out[5] = (uint8_t)n;
    out[6] = (uint8_t)w->state;
    out[7] = (uint8_t)w->refusal;
    write_u64(out + 8, (uint64_t)now_us);
    write_u64(out + 16, nonce);
    write_u64(out + 24, w->challenge);
    write_u64(out + 32, w->epoch);
    write_u32(out + 40, w->boot_id);
    write_u32(out + 44, w->samples);
    write_u32(out + 48, w->candidate ? w->candidate_counter : w->counter);
    for (size_t i = 0; i < 3; i++) {
        write_f32(out + 52 + 4 * i, gyro[i]);
        write_f32(out + 64 + 4 * i, accelerometer[i]);
    }
    for (size_t i = 0; i < n; i++)
        write_f32(out + 76 + 4 * i, thrusts[i]);
    ll_hmac_of(&w->hmac, out, size, digest);
    memcpy(out + size, digest, LL_MAC_BYTES);
    return size + LL_MAC_BYTES;
}

void ll_halt(ll_watchdog *w)
{
    if (w->state != LL_STOPPED_BY_WIRE) /* which says more */
        refuse(w);
    w->candidate = 0;
}

void ll_wire(ll_watchdog *w, bool open)
{
    w->e_stop = open ? LL_OPEN : LL_CLOSED;
    if (!open)
        return;
    refuse(w);
    w->state = LL_STOPPED_BY_WIRE;
    w->refusal = LL_WIRE;
    w->candidate = 0;
}
