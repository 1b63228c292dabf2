/* What the robot tells of itself beside its samples, and when: the same bytes as
 * hardware/link/health_datagram.py, the same times as hardware/link/health_end.py. It only reads the watchdog's
 * key, boot id and emergency stop. Leave it out of a robot that knows nothing of itself.
 */
#ifndef LIGHTLEASH_HEALTH_H
#define LIGHTLEASH_HEALTH_H

#include "watchdog.h"

#define LL_HEALTH_BYTES 44
#define LL_HEALTH_EVERY_US 200000

typedef struct {
    bool tells;
    ll_e_stop e_stop; /* told last */
    uint32_t counter;
    int64_t told_us;
} ll_health;

/* Nothing told yet. */
void ll_health_init(ll_health *h);

/* Write what is due now, to be sent to whom samples go; gives its size, 0 if nothing is due.
 * `battery_v`: 0 to 1000 [V], or NAN if it is not known. Ask after each sample. */
size_t ll_health_due(ll_health *h, const ll_watchdog *w, float battery_v, int64_t now_us,
                     uint8_t out[LL_HEALTH_BYTES]);

#endif
