/* Wire format of a node of modalwatch, for any C or C++ compiler and any controller that is little-endian.
 *
 * It allocates no memory. Send the bytes that mw_scan and mw_hello write into `out`. Pass every received byte to mw_hear.
 */
#pragma once
#include <stdint.h>
#include <string.h>

enum { MW_SCAN = 0x01, MW_HELLO = 0x02, MW_WHO = 0x81, MW_START = 0x82, MW_STOP = 0x83, MW_LONGEST = 48 };

static inline uint16_t mw_crc(const uint8_t *data, size_t n) {
    uint16_t crc = 0xFFFF;
    while (n--) {
        crc ^= (uint16_t)(*data++ << 8);
        for (int bit = 0; bit < 8; bit++)
            crc = (uint16_t)(crc & 0x8000 ? crc << 1 ^ 0x1021 : crc << 1);
    }
    return crc;
}

/* Adds the CRC to n bytes of content (which needs room for two more), writes the frame, returns its length. */
static inline size_t mw_seal(uint8_t *content, size_t n, uint8_t *out) {
    uint16_t crc = mw_crc(content, n);
    size_t code = 0, at = 1;
    content[n++] = (uint8_t)crc;
    content[n++] = (uint8_t)(crc >> 8);
    for (size_t k = 0; k < n; k++) {
        if (content[k]) {
            out[at++] = content[k];
        } else {
            out[code] = (uint8_t)(at - code);
            code = at++;
        }
    }
    out[code] = (uint8_t)(at - code);
    out[at++] = 0;
    return at;
}

static inline size_t mw_scan(uint32_t counter, uint32_t us, const int32_t xyz[3], int16_t centidegrees, uint8_t out[MW_LONGEST]) {
    uint8_t content[25] = {MW_SCAN};
    memcpy(content + 1, &counter, 4);
    memcpy(content + 5, &us, 4);
    memcpy(content + 9, xyz, 12);
    memcpy(content + 21, &centidegrees, 2);
    return mw_seal(content, 23, out);
}

static inline size_t mw_hello(const char *product, const char *serial, uint8_t axes, float scale, uint32_t millihertz,
                uint8_t out[MW_LONGEST]) {
    uint8_t content[37] = {MW_HELLO, 1};
    strncpy((char *)content + 2, product, 12);
    strncpy((char *)content + 14, serial, 12);
    content[26] = axes;
    memcpy(content + 27, &scale, 4);
    memcpy(content + 31, &millihertz, 4);
    return mw_seal(content, 35, out);
}

/* Takes one byte from the host; returns MW_WHO, MW_START (then *millihertz is set) or MW_STOP, 0 if there is no command. */
static inline int mw_hear(uint8_t byte, uint32_t *millihertz) {
    static uint8_t frame[MW_LONGEST];
    static size_t n;
    if (byte) {
        frame[n < MW_LONGEST - 1 ? n++ : n] = byte; /* what is too long fails its CRC */
        return 0;
    }
    size_t size = n, code = 0;
    n = 0;
    if (size < 4)
        return 0;
    while (code < size) { /* put the zeros back */
        size_t next = code + frame[code];
        frame[code] = 0;
        code = next;
    }
    size_t content = size - 3;
    uint16_t crc = mw_crc(frame + 1, content);
    if (code != size || frame[size - 2] != (uint8_t)crc || frame[size - 1] != (uint8_t)(crc >> 8))
        return 0;
    if (frame[1] == MW_START && content == 5)
        memcpy(millihertz, frame + 2, 4);
    return frame[1];
}
