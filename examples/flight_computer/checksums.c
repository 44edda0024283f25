#include "checksums.h"

uint8_t crc8(const uint8_t *bytes, size_t n, uint8_t crc) {
    for (size_t i = 0; i < n; ++i) {
        crc ^= bytes[i];
        for (int bit = 0; bit < 8; ++bit) crc = (uint8_t)(crc << 1 ^ (crc & 0x80 ? 0x1D : 0));
    }
    return crc;
}

uint16_t crc16(const uint8_t *bytes, size_t n, uint16_t crc) {
    for (size_t i = 0; i < n; ++i) {
        crc ^= (uint16_t)(bytes[i] << 8);
        for (int bit = 0; bit < 8; ++bit) crc = (uint16_t)(crc << 1 ^ (crc & 0x8000 ? 0x1021 : 0));
    }
    return crc;
}

uint32_t crc32(const uint8_t *bytes, size_t n, uint32_t crc) {
    static uint32_t table[256];
    if (table[1] == 0)
        for (uint32_t i = 0; i < 256; ++i) {
            uint32_t c = i;
            for (int bit = 0; bit < 8; ++bit) c = c >> 1 ^ (c & 1 ? 0xEDB88320u : 0);
            table[i] = c;
        }
    crc = ~crc;
    for (size_t i = 0; i < n; ++i) crc = crc >> 8 ^ table[(crc ^ bytes[i]) & 0xFF];
    return ~crc;
}
