#include "blink.h"

#include "bytes.h"

#include <string.h>

#define BODY_BYTES (36u + LL_BLINK_SLOTS)
#define SHORTEST_MS 20u
#define LONGEST_MS 1000u
#define LASTS_MS 10000u
#define NONE 255

void ll_blink_init(ll_blink *b)
{
    memset(b, 0, sizeof *b);
    b->slot_us = 1000 * SHORTEST_MS;
}

bool ll_blink_receive(ll_blink *b, const ll_watchdog *w, const uint8_t *data, size_t size,
                      int64_t now_us)
{
    if (size != BODY_BYTES + LL_MAC_BYTES || memcmp(data, "LLbl\1\0", 6) != 0 ||
        !ll_hmac_fits(&w->hmac, data, BODY_BYTES, data + BODY_BYTES))
        return false;
    unsigned slot_ms = (unsigned)data[6] | (unsigned)data[7] << 8;
    uint64_t begin_us = read_u64(data + 24);
    uint32_t lasts_ms = read_u32(data + 32);
    if (slot_ms < SHORTEST_MS || slot_ms > LONGEST_MS || lasts_ms > LASTS_MS ||
        begin_us >> 60 != 0 || !ll_hears(w, read_u64(data + 8), read_u64(data + 16), now_us))
        return false;
    b->begin_us = (int64_t)begin_us;
    b->lasts_us = 1000 * (int64_t)lasts_ms;
    b->slot_us = 1000 * (int64_t)slot_ms;
    memcpy(b->dark, data + 36, LL_BLINK_SLOTS);
    return true;
}

int ll_blink_dark(const ll_blink *b, int64_t now_us)
{
    int64_t since_us = now_us - b->begin_us;
    if (since_us < 0 || since_us >= b->lasts_us)
        return LL_NO_LED;
    int dark = b->dark[since_us / b->slot_us % LL_BLINK_SLOTS];
    return dark == NONE ? LL_NO_LED : dark;
}
