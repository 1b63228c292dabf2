#include "health.h"

#include "bytes.h"

#include <math.h>
#include <string.h>

#define BODY_BYTES (LL_HEALTH_BYTES - LL_MAC_BYTES)

void ll_health_init(ll_health *h)
{
    memset(h, 0, sizeof *h);
    h->told_us = -LL_HEALTH_EVERY_US;
}

size_t ll_health_due(ll_health *h, const ll_watchdog *w, float battery_v, int64_t now_us,
                     uint8_t out[LL_HEALTH_BYTES])
{
    uint8_t digest[LL_DIGEST_BYTES];
    h->tells = h->tells || !isnan(battery_v) || w->e_stop != LL_NOT_WIRED;
    if (!h->tells || (now_us - h->told_us < LL_HEALTH_EVERY_US && w->e_stop == h->e_stop))
        return 0;
    h->e_stop = w->e_stop;
    h->told_us = now_us;
    h->counter++;
    memset(out, 0, LL_HEALTH_BYTES);
    memcpy(out, "LLhe\1", 5);
    out[5] = (uint8_t)w->e_stop;
    write_u64(out + 8, (uint64_t)now_us);
    write_u32(out + 16, w->boot_id);
    write_u32(out + 20, h->counter);
    write_f32(out + 24, isnan(battery_v) ? (float)NAN : battery_v);
    ll_hmac_of(&w->hmac, out, BODY_BYTES, digest);
    memcpy(out + BODY_BYTES, digest, LL_MAC_BYTES);
    return LL_HEALTH_BYTES;
}
