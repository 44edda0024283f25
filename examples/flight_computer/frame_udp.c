/* Frames in UDP datagrams (protocols/video/README.md). A frame is used if all its datagrams have come before one of the
 * next frame; a frame that lacks some is reported, counted and dropped. */
#include <arpa/inet.h>
#include <errno.h>
#include <inttypes.h>
#include <netinet/in.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>

#include "checksums.h"
#include "events.h"
#include "exit_status.h"
#include "frame_input.h"
#include "little_endian.h"

enum { HEADER_BYTES = 52, VERSION = 1, DATAGRAMS_MAX = 65536, BUFFER_BYTES = 8 << 20, NUMBERS_KEPT = 64 };
static const double kSilence_s = 0.3; /* after this a frame that lacks datagrams has lost them */

static int fd = -1;
static int width, height;
static uint64_t lost_in_all;
static bool told_of_others;

static struct {
    bool is_open;
    bool any; /* one has ended */
    uint32_t number, count, came;
    int64_t t_ns, t_last_ns; /* of exposure; CLOCK_MONOTONIC of the last datagram */
    uint8_t has[DATAGRAMS_MAX];
    uint8_t pixels[IMAGE_BYTES_MAX];
} frame;

static int udp_open(const char *text, const struct camera_table *camera) {
    char address[256];
    snprintf(address, sizeof address, "%s", text + 4);
    address[strcspn(address, ",")] = '\0'; /* ,mtu=...: the sender's */
    char *colon = strrchr(address, ':'), *end;
    const char *port_text = colon != NULL ? colon + 1 : address;
    const long port = strtol(port_text, &end, 10);
    if (end == port_text || *end != '\0' || port < 1 || port > 65535) {
        event(EVENT_ERROR, "--video %s: expected udp:PORT with a port from 1 to 65535", text);
        return EXIT_BAD_INPUT;
    }
    struct ip_mreqn group = {.imr_ifindex = 0};
    bool is_group = false;
    if (colon != NULL) {
        *colon = '\0';
        address[strcspn(address, "%")] = '\0'; /* %INTERFACE: the sender's */
        is_group = inet_pton(AF_INET, address, &group.imr_multiaddr) == 1 &&
                   IN_MULTICAST(ntohl(group.imr_multiaddr.s_addr)); /* else the address of this machine */
    }
    width = camera->width, height = camera->height;
    fd = socket(AF_INET, SOCK_DGRAM, 0);
    const int on = 1, buffer = BUFFER_BYTES;
    if (is_group) setsockopt(fd, SOL_SOCKET, SO_REUSEADDR, &on, sizeof on);      /* it may have other receivers here */
    if (setsockopt(fd, SOL_SOCKET, SO_RCVBUFFORCE, &buffer, sizeof buffer) != 0) /* root only */
        setsockopt(fd, SOL_SOCKET, SO_RCVBUF, &buffer, sizeof buffer);           /* at most net.core.rmem_max */
    const struct sockaddr_in at = {
        .sin_family = AF_INET, .sin_port = htons((uint16_t)port), .sin_addr.s_addr = htonl(INADDR_ANY)};
    if (fd < 0 || bind(fd, (const struct sockaddr *)&at, sizeof at) != 0 ||
        (is_group && setsockopt(fd, IPPROTO_IP, IP_ADD_MEMBERSHIP, &group, sizeof group) != 0)) {
        event(EVENT_ERROR, "--video %s: %s", text, strerror(errno));
        return EXIT_NO_DEVICE;
    }
    return 0;
}

static void end_frame(void) {
    const uint32_t lost = frame.count - frame.came;
    if (lost > 0)
        event(EVENT_WARNING, "frame %" PRIu32 ": %" PRIu32 " of %" PRIu32 " datagrams lost", frame.number, lost,
              frame.count);
    lost_in_all += lost;
    frame.is_open = false, frame.any = true;
}

/* Takes a datagram of `n` bytes; true: its frame is complete. */
static bool take(const uint8_t *b, size_t n) {
    if (n <= HEADER_BYTES || memcmp(b, "NRPD", 4) != 0 || u16_at(b + 4) != VERSION || u16_at(b + 6) != HEADER_BYTES)
        return false;
    const size_t bytes = n - HEADER_BYTES;
    if (u32_at(b + 48) != crc32(b + HEADER_BYTES, bytes, crc32(b, 48, 0))) return false;
    const uint32_t w = u16_at(b + 24), h = u16_at(b + 26), row_bytes = u32_at(b + 28);
    if (memcmp(b + 20, "GREY", 4) != 0 || w != (uint32_t)width || h != (uint32_t)height || row_bytes != w) {
        if (!told_of_others)
            event(EVENT_ERROR, "frames of %" PRIu32 " x %" PRIu32 " %.4s on the port, expected %d x %d GREY", w, h,
                  (const char *)b + 20, width, height);
        told_of_others = true;
        return false;
    }
    const uint32_t index = u32_at(b + 32), count = u32_at(b + 36), row = u32_at(b + 40), byte = u32_at(b + 44);
    const uint64_t size = (uint64_t)row_bytes * h, begin = (uint64_t)row * row_bytes + byte;
    if (index >= count || count > DATAGRAMS_MAX || begin + bytes > size) return false;

    const uint32_t number = u32_at(b + 16);
    const int32_t newer = (int32_t)(number - frame.number);
    if ((frame.is_open || frame.any) && newer > -NUMBERS_KEPT && newer < (frame.is_open ? 0 : 1))
        return false; /* too late */
    if (!frame.is_open || number != frame.number) {
        if (frame.is_open) end_frame();
        frame.is_open = true, frame.number = number, frame.count = count, frame.came = 0, frame.t_ns = i64_at(b + 8);
        memset(frame.has, 0, count);
    }
    frame.t_last_ns = monotonic_ns();
    if (count != frame.count || frame.has[index]) return false;
    frame.has[index] = 1, ++frame.came;
    memcpy(frame.pixels + begin, b + HEADER_BYTES, bytes);
    return frame.came == frame.count;
}

static bool udp_receive(struct frame *out) {
    static uint8_t datagram[65536];
    for (;;) {
        const ssize_t n = recv(fd, datagram, sizeof datagram, MSG_DONTWAIT);
        if (n < 0 && errno == EINTR) continue;
        if (n < 0) break;
        if (!take(datagram, (size_t)n)) continue;
        end_frame();
        memcpy(out->pixels, frame.pixels, (size_t)width * (size_t)height);
        out->is_timed = true, out->t_ns = frame.t_ns;
        return true;
    }
    if (frame.is_open && monotonic_ns() - frame.t_last_ns > (int64_t)(kSilence_s * 1e9)) end_frame();
    return false;
}

static int udp_fd(void) { return fd; }
static uint64_t udp_lost(void) { return lost_in_all; }

const struct frame_source udp_source = {udp_open, udp_fd, udp_receive, udp_lost};
