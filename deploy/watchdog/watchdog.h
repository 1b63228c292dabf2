/* Robot's end of the Lightleash link: gate, watchdog and ramp, for firmware.
 *
 * The same rules as hardware/link/robot_end.py, the same bytes as hardware/link/datagram.py; both are held
 * against each other by tests/hardware/link/test_watchdog.py. No heap, no clock, no I/O, no globals:
 * the firmware brings datagrams, time (one monotonic clock, in microseconds) and random numbers.
 * Call everything from one task.
 */
#ifndef LIGHTLEASH_WATCHDOG_H
#define LIGHTLEASH_WATCHDOG_H

#include "attitude.h"
#include "hmac.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define LL_MAX_BYTES (92 + 4 * LL_MAX_THRUSTERS)
#define LL_NONCES 32

#define LL_SILENCE_US 60000
#define LL_RAMP_AFTER_US 280000
#define LL_BACK_UNTIL_US 400000
#define LL_MAX_AGE_US 40000
#define LL_HANDSHAKE_US 500000
#define LL_MAX_JUMP 200u
#define LL_MEAN_OF 80 /* commands until the mean has forgotten two thirds: 0.4 s */
#define LL_TO_MEAN_US 100000

typedef enum { LL_IDLE, LL_RUNNING, LL_RAMP, LL_REFUSING, LL_COAST, LL_STOPPED_BY_WIRE } ll_state;

typedef enum { LL_NOT_WIRED, LL_CLOSED, LL_OPEN } ll_e_stop;

typedef enum {
    LL_NONE, LL_STARTED, LL_SILENT, LL_MALFORMED, LL_THRUSTERS, LL_NONCE, LL_STALE, LL_EPOCH,
    LL_COUNTER, LL_NOT_FINITE, LL_LIMITS, LL_RISE, LL_ZERO_FIRST, LL_HANDSHAKE, LL_WIRE, LL_FAULT,
    LL_NOT_ARMED, LL_MODE
} ll_refusal;

typedef struct {
    uint8_t thrusters; /* 1 to LL_MAX_THRUSTERS */
    double f_max;      /* [N] */
    double max_rise;   /* per command [N] */
    int64_t ramp_us;   /* one period of the suspension */
    const ll_attitude_gains *attitude; /* of a robot that flies; else NULL */
} ll_limits;

typedef struct {
    ll_limits limits;
    ll_hmac hmac;
    uint32_t boot_id;
    ll_state state;
    ll_refusal refusal;
    ll_e_stop e_stop;   /* as `ll_wire` was told last */
    uint64_t epoch;     /* followed now or last, 0 none */
    uint64_t candidate; /* epoch in its handshake, 0 none */
    uint32_t counter, candidate_counter; /* of the newest command taken of either */
    bool replaced;      /* a later epoch was taken: the one followed has no way back */
    int64_t taken_us, shaken_us; /* when that was */
    int64_t handshake_us, fading_us; /* when they began */
    bool fading, catching_up;
    double commanded[LL_MAX_THRUSTERS], base[LL_MAX_THRUSTERS]; /* last command; given, unfaded */
    double mean[LL_MAX_THRUSTERS]; /* of what was given lately */
    int averaged;       /* of how many since thrust began */
    ll_attitude attitude;
    int64_t sampled_us;
    struct { uint64_t nonce; int64_t sent_us; } nonces[LL_NONCES];
    uint32_t samples;
    uint64_t newest_epoch, challenge; /* of the newest command heard, taken or not */
    uint32_t newest_counter;
} ll_watchdog;

/* Refusing, until zero thrust has been seen for long enough. `boot_id`: another one each start.
 * False, and refusing everything for ever: unless 1 to LL_MAX_THRUSTERS thrusters, and f_max,
 * max_rise and ramp_us finite and above 0. */
bool ll_init(ll_watchdog *w, const ll_limits *limits, uint32_t boot_id,
             const uint8_t key[LL_KEY_BYTES]);

/* Take or refuse a datagram; LL_NONE if it was taken: from now on samples go to its sender.
 * `*answer`: its sender gets the next sample, whoever gets the others. Any bytes are safe. */
ll_refusal ll_receive(ll_watchdog *w, const uint8_t *data, size_t size, int64_t now_us,
                      bool *answer);

/* Whether that is the newest control process, and it has just had a sample; no effect. */
bool ll_hears(const ll_watchdog *w, uint64_t epoch, uint64_t nonce, int64_t now_us);

/* What the thrusters are to give now [N], one number for each. Ask at least every 5 ms, whatever else happens. */
void ll_setpoint(ll_watchdog *w, int64_t now_us, float *thrusts);

/* Write the next sample, to be sent to control; gives its size. `nonce`: random, not 0;
 * `thrusts`: one number for each thruster. */
size_t ll_sample(ll_watchdog *w, int64_t now_us, uint64_t nonce, const float gyro[3],
                 const float accelerometer[3], const float *thrusts, uint8_t out[LL_MAX_BYTES]);

/* Zero at once, then refuse. */
void ll_halt(ll_watchdog *w);

/* What the emergency stop's wire says: open is pressed, or broken. Tell it before each `ll_setpoint` if the
 * robot has one. Zero at once, and stopped until it is closed and a new handshake is over. */
void ll_wire(ll_watchdog *w, bool open);

#endif
