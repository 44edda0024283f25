/* checksums.h - each function continues an earlier run, `crc`. */
#ifndef CHECKSUMS_H
#define CHECKSUMS_H

#include <stddef.h>
#include <stdint.h>

enum { CRC8_START = 0xFF, CRC8_END = 0xFF, CRC16_START = 0xFFFF };
uint8_t crc8(const uint8_t *bytes, size_t n, uint8_t crc);    /* SAE-J1850: from CRC8_START, at last ^ CRC8_END */
uint16_t crc16(const uint8_t *bytes, size_t n, uint16_t crc); /* IBM-3740: from CRC16_START */
uint32_t crc32(const uint8_t *bytes, size_t n, uint32_t crc); /* IEEE 802.3: from 0 */

#endif
