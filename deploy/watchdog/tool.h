/* The robot's tool: whether it moves now and where to, as control ordered.
 *
 * The same rules as hardware/link/tool_end.py, the same bytes as hardware/link/tool_datagram.py. It only asks the
 * watchdog whether who speaks is the control process that it hears now: it can't change it.
 * Leave it out of a robot without a tool; orders are malformed commands to it, and change nothing.
 */
#ifndef LIGHTLEASH_TOOL_H
#define LIGHTLEASH_TOOL_H

#include "watchdog.h"

#define LL_TOOL_OPEN 10000
#define LL_TOOL_STAYS (-1)
#define LL_TOOL_LASTS_US 100000

typedef struct {
    int64_t told_us;
    int opening;
} ll_tool;

/* It stays as it is. */
void ll_tool_init(ll_tool *t);

/* Whether the datagram was a tool order, and taken. If not, it may be a command: `ll_receive`. */
bool ll_tool_receive(ll_tool *t, const ll_watchdog *w, const uint8_t *data, size_t size, int64_t now_us);

/* How far it shall be open, 0 to LL_TOOL_OPEN, or LL_TOOL_STAYS. Ask after each `ll_setpoint`. */
int ll_tool_wanted(const ll_tool *t, const ll_watchdog *w, int64_t now_us);

#endif
