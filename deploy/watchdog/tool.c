#include "tool.h"

#include "bytes.h"

#include <string.h>

#define BODY_BYTES 24u

void ll_tool_init(ll_tool *t)
{
    t->told_us = 0;
    t->opening = LL_TOOL_STAYS;
}

bool ll_tool_receive(ll_tool *t, const ll_watchdog *w, const uint8_t *data, size_t size, int64_t now_us)
{
    if (size != BODY_BYTES + LL_MAC_BYTES || memcmp(data, "LLtl\1\0", 6) != 0 ||
        !ll_hmac_fits(&w->hmac, data, BODY_BYTES, data + BODY_BYTES))
        return false;
    int opening = data[6] | data[7] << 8;
    if (opening > LL_TOOL_OPEN || !ll_hears(w, read_u64(data + 8), read_u64(data + 16), now_us))
        return false;
    t->told_us = now_us;
    t->opening = opening;
    return true;
}

int ll_tool_wanted(const ll_tool *t, const ll_watchdog *w, int64_t now_us)
{
    bool lasts = now_us - t->told_us < LL_TOOL_LASTS_US;
    return lasts && (w->state == LL_IDLE || w->state == LL_RUNNING) ? t->opening : LL_TOOL_STAYS;
}
