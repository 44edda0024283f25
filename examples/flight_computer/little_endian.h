/* little_endian.h - integers as narpa sends them. */
#ifndef LITTLE_ENDIAN_H
#define LITTLE_ENDIAN_H

#include <stdint.h>

static inline uint32_t u16_at(const uint8_t *b) { return (uint32_t)b[0] | (uint32_t)b[1] << 8; }
static inline uint32_t u32_at(const uint8_t *b) { return u16_at(b) | u16_at(b + 2) << 16; }
static inline int64_t i64_at(const uint8_t *b) {
    return (int64_t)((uint64_t)u32_at(b) | (uint64_t)u32_at(b + 4) << 32);
}

#endif
