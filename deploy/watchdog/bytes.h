/* Numbers in datagrams: little-endian. */
#ifndef LIGHTLEASH_BYTES_H
#define LIGHTLEASH_BYTES_H

#include <stdint.h>
#include <string.h>

static inline uint32_t read_u32(const uint8_t *p)
{
    return (uint32_t)p[0] | (uint32_t)p[1] << 8 | (uint32_t)p[2] << 16 | (uint32_t)p[3] << 24;
}

static inline uint64_t read_u64(const uint8_t *p)
{
    return (uint64_t)read_u32(p + 4) << 32 | read_u32(p);
}

static inline void write_u32(uint8_t *p, uint32_t value)
{
    for (int i = 0; i < 4; i++)
        p[i] = (uint8_t)(value >> (8 * i));
}

static inline void write_u64(uint8_t *p, uint64_t value)
{
    write_u32(p, (uint32_t)value);
    write_u32(p + 4, (uint32_t)(value >> 32));
}

static inline void write_f32(uint8_t *p, float value)
{
    uint32_t bits;
    memcpy(&bits, &value, sizeof bits);
    write_u32(p, bits);
}

#endif
