/* LEDs that say who they are: which of the robot's LEDs is dark now, as control ordered.
 *
 * The same rules as hardware/link/blink_end.py, the same bytes as hardware/link/blink_datagram.py. It only asks the
 * watchdog whether who speaks is the control process that it hears now: it can't change it.
 * Leave it out of a robot that can't blink; orders are malformed commands to it, and change nothing.
 */
#ifndef LIGHTLEASH_BLINK_H
#define LIGHTLEASH_BLINK_H

#include "watchdog.h"

#define LL_BLINK_SLOTS 8
#define LL_NO_LED (-1)

typedef struct {
    int64_t begin_us, lasts_us, slot_us;
    uint8_t dark[LL_BLINK_SLOTS];
} ll_blink;

/* All LEDs shine. */
void ll_blink_init(ll_blink *b);

/* Whether the datagram was a blink order, and taken. If not, it may be a command: `ll_receive`. */
bool ll_blink_receive(ll_blink *b, const ll_watchdog *w, const uint8_t *data, size_t size,
                      int64_t now_us);

/* The LED that is dark now, or LL_NO_LED. Ask at least every 5 ms. */
int ll_blink_dark(const ll_blink *b, int64_t now_us);

#endif
