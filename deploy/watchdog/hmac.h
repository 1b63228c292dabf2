/* HMAC-SHA-256 (FIPS 180-4, RFC 2104), its key prepared once: four blocks for a datagram. */
#ifndef LIGHTLEASH_HMAC_H
#define LIGHTLEASH_HMAC_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define LL_DIGEST_BYTES 32
#define LL_KEY_BYTES 16
#define LL_MAC_BYTES 16

typedef struct { uint32_t inner[8], outer[8]; } ll_hmac; /* SHA-256 after one block of each pad */

void ll_sha256(const uint8_t *data, size_t size, uint8_t digest[LL_DIGEST_BYTES]);
void ll_hmac_init(ll_hmac *h, const uint8_t *key, size_t size);
void ll_hmac_of(const ll_hmac *h, const uint8_t *data, size_t size,
                uint8_t digest[LL_DIGEST_BYTES]);

/* Whether the first LL_MAC_BYTES of the digest are `mac`, in a time that tells nothing more. */
bool ll_hmac_fits(const ll_hmac *h, const uint8_t *data, size_t size, const uint8_t *mac);

#endif
