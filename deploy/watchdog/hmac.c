#include "hmac.h"

#include <string.h>

#define BLOCK 64u

static const uint32_t START[8] = {0x6a09e667u, 0xbb67ae85u, 0x3c6ef372u, 0xa54ff53au,
                                  0x510e527fu, 0x9b05688cu, 0x1f83d9abu, 0x5be0cd19u};

static const uint32_t K[64] = {
    0x428a2f98u, 0x71374491u, 0xb5c0fbcfu, 0xe9b5dba5u, 0x3956c25bu, 0x59f111f1u, 0x923f82a4u,
    0xab1c5ed5u, 0xd807aa98u, 0x12835b01u, 0x243185beu, 0x550c7dc3u, 0x72be5d74u, 0x80deb1feu,
    0x9bdc06a7u, 0xc19bf174u, 0xe49b69c1u, 0xefbe4786u, 0x0fc19dc6u, 0x240ca1ccu, 0x2de92c6fu,
    0x4a7484aau, 0x5cb0a9dcu, 0x76f988dau, 0x983e5152u, 0xa831c66du, 0xb00327c8u, 0xbf597fc7u,
    0xc6e00bf3u, 0xd5a79147u, 0x06ca6351u, 0x14292967u, 0x27b70a85u, 0x2e1b2138u, 0x4d2c6dfcu,
    0x53380d13u, 0x650a7354u, 0x766a0abbu, 0x81c2c92eu, 0x92722c85u, 0xa2bfe8a1u, 0xa81a664bu,
    0xc24b8b70u, 0xc76c51a3u, 0xd192e819u, 0xd6990624u, 0xf40e3585u, 0x106aa070u, 0x19a4c116u,
    0x1e376c08u, 0x2748774cu, 0x34b0bcb5u, 0x391c0cb3u, 0x4ed8aa4au, 0x5b9cca4fu, 0x682e6ff3u,
    0x748f82eeu, 0x78a5636fu, 0x84c87814u, 0x8cc70208u, 0x90befffau, 0xa4506cebu, 0xbef9a3f7u,
    0xc67178f2u};

static uint32_t turned(uint32_t x, unsigned n)
{
    return x >> n | x << (32u - n);
}

static uint32_t read_be(const uint8_t *p)
{
    return (uint32_t)p[0] << 24 | (uint32_t)p[1] << 16 | (uint32_t)p[2] << 8 | (uint32_t)p[3];
}

/* FIPS 180-4, 6.2.2: one block. */
static void compress(uint32_t state[8], const uint8_t *block)
{
    uint32_t w[64], s[8];
    for (int t = 0; t < 16; t++)
        w[t] = read_be(block + 4 * t);
    for (int t = 16; t < 64; t++) {
        uint32_t a = w[t - 15], b = w[t - 2];
        w[t] = w[t - 16] + w[t - 7] + (turned(a, 7) ^ turned(a, 18) ^ a >> 3) +
               (turned(b, 17) ^ turned(b, 19) ^ b >> 10);
    }
    memcpy(s, state, sizeof s);
    for (int t = 0; t < 64; t++) {
        uint32_t e = s[4], a = s[0];
        uint32_t one = s[7] + (turned(e, 6) ^ turned(e, 11) ^ turned(e, 25)) +
                       ((e & s[5]) ^ (~e & s[6])) + K[t] + w[t];
        uint32_t two = (turned(a, 2) ^ turned(a, 13) ^ turned(a, 22)) +
                       ((a & s[1]) ^ (a & s[2]) ^ (s[1] & s[2]));
        memmove(s + 1, s, 7 * sizeof *s);
        s[4] += one;
        s[0] = one + two;
    }
    for (int i = 0; i < 8; i++)
        state[i] += s[i];
}

/* Go on from `state`, which has seen `before` bytes, to the end of the message. */
static void finish(uint32_t state[8], const uint8_t *data, size_t size, uint64_t before,
                   uint8_t digest[LL_DIGEST_BYTES])
{
    uint64_t bits = 8u * (before + size);
    uint8_t last[2 * BLOCK] = {0};
    for (; size >= BLOCK; size -= BLOCK, data += BLOCK)
        compress(state, data);
    if (size > 0)
        memcpy(last, data, size);
    last[size] = 0x80;
    size_t length = size < BLOCK - 8 ? BLOCK : 2 * BLOCK;
    for (unsigned i = 0; i < 8; i++)
        last[length - 1 - i] = (uint8_t)(bits >> 8 * i);
    for (size_t at = 0; at < length; at += BLOCK)
        compress(state, last + at);
    for (unsigned i = 0; i < LL_DIGEST_BYTES; i++)
        digest[i] = (uint8_t)(state[i / 4] >> (24 - 8 * (i % 4)));
}

void ll_sha256(const uint8_t *data, size_t size, uint8_t digest[LL_DIGEST_BYTES])
{
    uint32_t state[8];
    memcpy(state, START, sizeof state);
    finish(state, data, size, 0, digest);
}

void ll_hmac_init(ll_hmac *h, const uint8_t *key, size_t size)
{
    uint8_t short_key[BLOCK] = {0}, pad[BLOCK];
    if (size > BLOCK)
        ll_sha256(key, size, short_key);
    else
        memcpy(short_key, key, size);
    memcpy(h->inner, START, sizeof h->inner);
    memcpy(h->outer, START, sizeof h->outer);
    for (unsigned i = 0; i < BLOCK; i++)
        pad[i] = short_key[i] ^ 0x36;
    compress(h->inner, pad);
    for (unsigned i = 0; i < BLOCK; i++)
        pad[i] = short_key[i] ^ 0x5c;
    compress(h->outer, pad);
}

void ll_hmac_of(const ll_hmac *h, const uint8_t *data, size_t size,
                uint8_t digest[LL_DIGEST_BYTES])
{
    uint32_t state[8];
    uint8_t inner[LL_DIGEST_BYTES];
    memcpy(state, h->inner, sizeof state);
    finish(state, data, size, BLOCK, inner);
    memcpy(state, h->outer, sizeof state);
    finish(state, inner, sizeof inner, BLOCK, digest);
}

bool ll_hmac_fits(const ll_hmac *h, const uint8_t *data, size_t size, const uint8_t *mac)
{
    uint8_t digest[LL_DIGEST_BYTES], differs = 0;
    ll_hmac_of(h, data, size, digest);
    for (unsigned i = 0; i < LL_MAC_BYTES; i++)
        differs |= (uint8_t)(digest[i] ^ mac[i]);
    return differs == 0;
}
