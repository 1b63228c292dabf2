#include "watchdog.h"

#include <math.h>
#include <string.h>

#define ROUNDING (1.0 + 1e-6) /* thrusts travel as 32-bit floats */
#define COMMAND_OVERHEAD 32u

typedef struct {
    bool armed;
    uint32_t epoch, counter, nonce;
    uint64_t robot_time_us;
    uint8_t thrusters;
    float thrusts[LL_MAX_THRUSTERS];
} command;

static uint32_t read_u32(const uint8_t *p)
{
    return (uint32_t)p[0] | (uint32_t)p[1] << 8 | (uint32_t)p[2] << 16 | (uint32_t)p[3] << 24;
}

static void write_u32(uint8_t *p, uint32_t value)
{
    for (int i = 0; i < 4; i++)
        p[i] = (uint8_t)(value >> (8 * i));
}

static float read_f32(const uint8_t *p)
{
    uint32_t bits = read_u32(p);
    float value;
    memcpy(&value, &bits, sizeof value);
    return value;
}

static void write_f32(uint8_t *p, float value)
{
    uint32_t bits;
    memcpy(&bits, &value, sizeof bits);
    write_u32(p, bits);
}

static uint32_t crc32(const uint8_t *data, size_t size)
{
    uint32_t crc = 0xFFFFFFFFu;
    for (size_t i = 0; i < size; i++) {
        crc ^= data[i];
        for (int bit = 0; bit < 8; bit++)
            crc = crc >> 1 ^ (crc & 1u ? 0xEDB88320u : 0u);
    }
    return ~crc;
}

static bool decode(const uint8_t *data, size_t size, command *c)
{
    if (size <= COMMAND_OVERHEAD || size > LL_MAX_BYTES || memcmp(data, "LLcm\1", 5) != 0)
        return false;
    c->thrusters = data[5];
    if (c->thrusters > LL_MAX_THRUSTERS || size != COMMAND_OVERHEAD + 4u * c->thrusters)
        return false;
    if (read_u32(data + size - 4) != crc32(data, size - 4) || data[6] > 1 || data[7] != 0)
        return false;
    c->armed = data[6] == 1;
    c->epoch = read_u32(data + 8);
    c->counter = read_u32(data + 12);
    c->robot_time_us = (uint64_t)read_u32(data + 20) << 32 | read_u32(data + 16);
    c->nonce = read_u32(data + 24);
    for (int i = 0; i < c->thrusters; i++)
        c->thrusts[i] = read_f32(data + 28 + 4 * i);
    return true;
}

static bool any(const float *thrusts, int n)
{
    for (int i = 0; i < n; i++)
        if (thrusts[i] != 0.0f)
            return true;
    return false;
}

static void refuse(ll_watchdog *w)
{
    w->state = LL_REFUSING;
    w->refusal = LL_SILENT;
    w->candidate = 0;
    memset(w->thrusts, 0, sizeof w->thrusts);
}

/* Let time do its work: silence, ramp, abandoned handshakes. */
static void advance(ll_watchdog *w, int64_t now_us)
{
    bool silent = now_us - w->taken_us > LL_SILENCE_US;
    if (w->state == LL_RAMP) {
        if (now_us - w->since_us >= w->limits.ramp_us)
            refuse(w);
    } else if (w->state == LL_REFUSING) {
        if (silent && w->candidate) {
            w->candidate = 0;
            w->refusal = LL_SILENT;
        }
    } else if (silent && any(w->thrusts, w->limits.thrusters)) {
        w->state = LL_RAMP;
        w->refusal = LL_SILENT;
        w->since_us = now_us;
    } else if (silent) {
        refuse(w);
    }
}

static bool epoch_fits(const ll_watchdog *w, uint32_t epoch)
{
    if (w->state != LL_REFUSING)
        return epoch == w->epoch;
    if (w->candidate)
        return epoch == w->candidate;
    uint32_t ahead = epoch - w->epoch;
    return epoch != 0 && (w->epoch == 0 || (ahead > 0 && ahead < 0x80000000u));
}

static ll_refusal judge_nonce(const ll_watchdog *w, const command *c, int64_t now_us)
{
    for (int i = 0; c->nonce != 0 && i < LL_NONCES; i++) {
        if (w->nonces[i].nonce != c->nonce)
            continue;
        if ((uint64_t)w->nonces[i].sent_us != c->robot_time_us)
            return LL_NONCE;
        return now_us - w->nonces[i].sent_us > LL_MAX_AGE_US ? LL_STALE : LL_NONE;
    }
    return LL_NONCE;
}

static ll_refusal judge_thrusts(const ll_watchdog *w, const command *c, uint32_t ahead)
{
    bool meant = any(c->thrusts, c->thrusters), beyond = meant && !c->armed, rises = false;
    for (int i = 0; i < c->thrusters; i++)
        if (!isfinite(c->thrusts[i]))
            return LL_NOT_FINITE;
    for (int i = 0; i < c->thrusters; i++) {
        double thrust = c->thrusts[i], allowed = w->thrusts[i] + ahead * w->limits.max_rise;
        beyond = beyond || thrust < 0.0 || thrust > w->limits.f_max * ROUNDING;
        rises = rises || thrust > allowed * ROUNDING;
    }
    if (beyond)
        return LL_LIMITS;
    if (meant && w->state == LL_REFUSING)
        return LL_ZERO_FIRST;
    if (meant && w->state == LL_RAMP)
        return LL_SILENT;
    return rises ? LL_RISE : LL_NONE;
}

static ll_refusal judge(const ll_watchdog *w, const command *c, int64_t now_us)
{
    if (c->thrusters != w->limits.thrusters)
        return LL_THRUSTERS;
    ll_refusal why = judge_nonce(w, c, now_us);
    if (why != LL_NONE)
        return why;
    if (!epoch_fits(w, c->epoch))
        return LL_EPOCH;
    uint32_t ahead = c->counter - w->counter;
    bool beginning = w->state == LL_REFUSING && !w->candidate;
    if (!beginning && (ahead < 1 || ahead > LL_MAX_JUMP))
        return LL_COUNTER;
    return judge_thrusts(w, c, ahead);
}

static void take(ll_watchdog *w, const command *c, int64_t now_us)
{
    w->taken_us = now_us;
    w->counter = c->counter;
    if (w->state == LL_RAMP) {
        refuse(w);
    } else if (w->state != LL_REFUSING) {
        memcpy(w->thrusts, c->thrusts, c->thrusters * sizeof *c->thrusts);
        w->state = any(w->thrusts, c->thrusters) ? LL_RUNNING : LL_IDLE;
        w->refusal = LL_NONE;
    } else {
        if (!w->candidate) {
            w->candidate = c->epoch;
            w->since_us = now_us;
        }
        w->refusal = LL_HANDSHAKE;
        if (now_us - w->since_us >= LL_HANDSHAKE_US) {
            w->epoch = w->candidate;
            w->candidate = 0;
            w->state = LL_IDLE;
            w->refusal = LL_NONE;
        }
    }
}

void ll_init(ll_watchdog *w, const ll_limits *limits, uint32_t boot_id)
{
    memset(w, 0, sizeof *w);
    w->limits = *limits;
    w->boot_id = boot_id;
    w->state = LL_REFUSING;
    w->refusal = LL_STARTED;
}

ll_refusal ll_receive(ll_watchdog *w, const uint8_t *data, size_t size, int64_t now_us)
{
    command c;
    if (!decode(data, size, &c))
        return LL_MALFORMED;
    advance(w, now_us);
    ll_refusal why = judge(w, &c, now_us);
    if (why == LL_NONE) {
        take(w, &c, now_us);
    } else if (w->state != LL_RAMP) {
        w->refusal = why;
        if (why == LL_ZERO_FIRST)
            w->candidate = 0;
    }
    return why;
}

void ll_setpoint(ll_watchdog *w, int64_t now_us, float *thrusts)
{
    advance(w, now_us);
    float share = 1.0f;
    if (w->state == LL_RAMP && now_us > w->since_us)
        share = (float)(1.0 - (double)(now_us - w->since_us) / (double)w->limits.ramp_us);
    for (int i = 0; i < w->limits.thrusters; i++)
        thrusts[i] = share * w->thrusts[i];
}

size_t ll_sample(ll_watchdog *w, int64_t now_us, uint32_t nonce, const float gyro[3],
                 const float accelerometer[3], const float *thrusts, uint8_t out[LL_MAX_BYTES])
{
    uint8_t *p = out;
    size_t n = w->limits.thrusters;
    advance(w, now_us);
    w->samples++;
    w->nonces[w->samples % LL_NONCES].nonce = nonce;
    w->nonces[w->samples % LL_NONCES].sent_us = now_us;
    memcpy(p, "LLsm\1", 5);
    p[5] = (uint8_t)n;
    p[6] = (uint8_t)w->state;
    p[7] = (uint8_t)w->refusal;
    const uint32_t words[] = {(uint32_t)now_us, (uint32_t)((uint64_t)now_us >> 32), w->boot_id,
                              w->samples, nonce, w->epoch, w->counter};
    for (size_t i = 0; i < 7; i++)
        write_u32(p + 8 + 4 * i, words[i]);
    for (size_t i = 0; i < 3; i++) {
        write_f32(p + 36 + 4 * i, gyro[i]);
        write_f32(p + 48 + 4 * i, accelerometer[i]);
    }
    for (size_t i = 0; i < n; i++)
        write_f32(p + 60 + 4 * i, thrusts[i]);
    write_u32(p + 60 + 4 * n, crc32(out, 60 + 4 * n));
    return 64 + 4 * n;
}

void ll_halt(ll_watchdog *w)
{
    refuse(w);
}
