/* Receives frames that narpa sends as UDP datagrams, and says of each how many datagrams were lost.
 *
 *     cc -O2 -o receive receive.c
 *     ./receive 5004                # a line for each frame
 *     ./receive 5004 frame_%u.raw   # and its bytes, rows from the top, to a file
 *     narpa run docking --video nav=udp:127.0.0.1:5004
 *
 * A start for a driver on a flight computer, or a model of one in an FPGA: C11, no library but the sockets. The table of
 * the header is in protocols/video/README.md. A frame ends when all its datagrams have come, or when one of the next
 * frame comes. Where the network may exchange datagrams of two frames, keep two frames, as python/narpa/datagrams.py
 * does.
 */
#include <arpa/inet.h>
#include <inttypes.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>

enum { HEADER_BYTES = 52, VERSION = 1, MOST_BYTES = 256 << 20 };

/* Little-endian numbers. */
static uint32_t u16_at(const uint8_t *b) { return (uint32_t)b[0] | (uint32_t)b[1] << 8; }
static uint32_t u32_at(const uint8_t *b) { return u16_at(b) | u16_at(b + 2) << 16; }
static int64_t i64_at(const uint8_t *b) { return (int64_t)((uint64_t)u32_at(b) | (uint64_t)u32_at(b + 4) << 32); }

/* CRC-32 of IEEE 802.3, a byte at a time. `crc` continues an earlier run. */
static uint32_t crc32_of(const uint8_t *bytes, size_t n, uint32_t crc) {
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

struct frame {
    int begun;
    uint32_t number, width, height, row_bytes, count, came;
    int64_t t_ns;
    char format[5];
    uint8_t *bytes;     /* row_bytes * height */
    uint8_t *have;      /* one for each datagram */
    size_t room, slots; /* what they hold */
};

static void *grown(void *old, size_t *room, size_t bytes) {
    if (bytes <= *room) return old;
    *room = bytes;
    void *grown = realloc(old, bytes);
    if (grown == NULL) fputs("receive: no memory for a frame\n", stderr), exit(1);
    return grown;
}

static void end_frame(struct frame *f, const char *pattern) {
    if (!f->begun) return;
    f->begun = 0;
    const char last = (char)(f->format[3] & 0x7F); /* the bit above is V4L2's mark of big-endian formats */
    printf("frame %" PRIu32 ": %" PRIu32 " x %" PRIu32 " %.3s%.*s%s, t = %.6f s, %" PRIu32 " of %" PRIu32
           " datagrams lost\n",
           f->number, f->width, f->height, f->format, last != ' ', &last, f->format[3] & 0x80 ? "-BE" : "", 1e-9 * (double)f->t_ns, f->count - f->came, f->count);
    fflush(stdout);
    if (pattern == NULL) return;
    const char *at = strstr(pattern, "%u");
    char name[4096];
    snprintf(name, sizeof name, "%.*s%" PRIu32 "%s", (int)(at - pattern), pattern, f->number, at + 2);
    FILE *file = fopen(name, "wb");
    if (file == NULL || fwrite(f->bytes, f->row_bytes, f->height, file) != f->height || fclose(file) != 0)
        fprintf(stderr, "receive: cannot write %s\n", name), exit(1);
}

/* Takes a datagram of `n` bytes; 0: it is not valid. */
static int take(struct frame *f, const uint8_t *b, size_t n, const char *pattern) {
    if (n <= HEADER_BYTES || memcmp(b, "NRPD", 4) != 0 || u16_at(b + 4) != VERSION || u16_at(b + 6) != HEADER_BYTES)
        return 0;
    const size_t bytes = n - HEADER_BYTES;
    if (u32_at(b + 48) != crc32_of(b + HEADER_BYTES, bytes, crc32_of(b, 48, 0))) return 0;
    const uint32_t width = u16_at(b + 24), height = u16_at(b + 26), row_bytes = u32_at(b + 28);
    const uint32_t index = u32_at(b + 32), count = u32_at(b + 36), row = u32_at(b + 40), byte = u32_at(b + 44);
    const uint64_t size = (uint64_t)row_bytes * height, begin = (uint64_t)row * row_bytes + byte;
    if (size > MOST_BYTES || index >= count || count > size || byte >= row_bytes || begin + bytes > size) return 0;

    const uint32_t number = u32_at(b + 16);
    const int32_t newer = (int32_t)(number - f->number);
    if (f->count > 0 && newer > -64 && newer < (f->begun ? 0 : 1)) return 1; /* too late: its frame has ended */
    if (!f->begun || number != f->number || count != f->count || row_bytes != f->row_bytes || height != f->height) {
        end_frame(f, pattern);
        f->begun = 1, f->number = number, f->width = width, f->height = height, f->row_bytes = row_bytes;
        f->count = count, f->came = 0, f->t_ns = i64_at(b + 8);
        memcpy(f->format, b + 20, 4);
        f->bytes = grown(f->bytes, &f->room, size);
        f->have = grown(f->have, &f->slots, count);
        memset(f->bytes, 0, size), memset(f->have, 0, count);
    }
    if (f->have[index]) return 1; /* it came twice */
    f->have[index] = 1, ++f->came;
    memcpy(f->bytes + begin, b + HEADER_BYTES, bytes);
    if (f->came == f->count) end_frame(f, pattern);
    return 1;
}

int main(int argc, char **argv) {
    const char *pattern = argc > 2 ? argv[2] : NULL;
    const long port = argc > 1 ? strtol(argv[1], NULL, 10) : 0;
    if (port < 1 || port > 65535 || (pattern != NULL && strstr(pattern, "%u") == NULL))
        return fputs("usage: receive PORT [FILE_WITH_%u]\n", stderr), 2;
    const int fd = socket(AF_INET, SOCK_DGRAM, 0), room = 8 << 20;
    const struct sockaddr_in at = {
        .sin_family = AF_INET, .sin_port = htons((uint16_t)port), .sin_addr.s_addr = htonl(INADDR_ANY)};
    setsockopt(fd, SOL_SOCKET, SO_RCVBUF, &room, sizeof room); /* at most net.core.rmem_max */
    if (fd < 0 || bind(fd, (const struct sockaddr *)&at, sizeof at) != 0) return perror("receive"), 1;
    static uint8_t datagram[65536];
    static struct frame frame;
    for (;;) {
        const ssize_t n = recv(fd, datagram, sizeof datagram, 0);
        if (n < 0) return perror("receive"), 1;
        if (!take(&frame, datagram, (size_t)n, pattern)) fputs("receive: a datagram that is none of a frame\n", stderr);
    }
}
