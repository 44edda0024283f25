/* slcan over TCP: a frame is a line, t, three hexadecimal digits of the identifier, the length, the bytes. Classic
 * frames only. The hub answers C, S8 and O with a carriage return each; after the last one no frame of the bus is
 * missed. */
#include <errno.h>
#include <netdb.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <unistd.h>

#include "can_bus.h"

enum { SECONDS_TO_ANSWER = 5, SECONDS_TO_SEND = 1 };

static bool send_all(int fd, const char *text, size_t n) {
    while (n > 0) {
        const ssize_t sent = send(fd, text, n, MSG_NOSIGNAL);
        if (sent < 0 && errno == EINTR) continue;
        if (sent <= 0) return false;
        text += sent, n -= (size_t)sent;
    }
    return true;
}

static const char *greet(int fd) {
    static const char greeting[] = "C\rS8\rO\r";
    if (!send_all(fd, greeting, sizeof greeting - 1)) return strerror(errno);
    for (int answers = 0; answers < 3;) {
        char answer = 0;
        const ssize_t n = recv(fd, &answer, 1, 0);
        if (n < 0 && errno == EINTR) continue;
        if (n < 0) return errno == EAGAIN ? "it does not answer" : strerror(errno);
        if (n == 0) return "the hub has closed the connection: it has as many clients as it takes";
        if (answer != '\r') return "it does not answer as an slcan hub";
        ++answers;
    }
    return NULL;
}

const char *slcan_open(struct can_bus *bus, const char *host, const char *port) {
    const struct addrinfo wanted = {.ai_family = AF_INET, .ai_socktype = SOCK_STREAM};
    struct addrinfo *found = NULL;
    const int status = getaddrinfo(host, port, &wanted, &found);
    if (status != 0) return gai_strerror(status);
    const int fd = socket(AF_INET, SOCK_STREAM, 0), on = 1;
    setsockopt(fd, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
    setsockopt(fd, SOL_SOCKET, SO_RCVTIMEO, &(struct timeval){.tv_sec = SECONDS_TO_ANSWER}, sizeof(struct timeval));
    setsockopt(fd, SOL_SOCKET, SO_SNDTIMEO, &(struct timeval){.tv_sec = SECONDS_TO_SEND}, sizeof(struct timeval));
    const bool connected = connect(fd, found->ai_addr, found->ai_addrlen) == 0;
    const char *trouble = connected ? greet(fd) : strerror(errno);
    freeaddrinfo(found);
    if (trouble != NULL)
        close(fd);
    else
        bus->fd = fd;
    return trouble;
}

static int hex(char c) {
    return c >= '0' && c <= '9'   ? c - '0'
           : c >= 'A' && c <= 'F' ? c - 'A' + 10
           : c >= 'a' && c <= 'f' ? c - 'a' + 10
                                  : -1;
}

/* A line without its carriage return; false: not a data frame with an identifier of 11 bits. */
static bool parse(const char *line, size_t n, struct can_frame_bytes *frame) {
    if (n < 5 || line[0] != 't') return false;
    int digits[3 + 1 + 16];
    for (size_t i = 1; i < n; ++i)
        if (i > sizeof digits / sizeof digits[0] || (digits[i - 1] = hex(line[i])) < 0) return false;
    const int length = digits[3];
    if (length > 8 || n != (size_t)(5 + 2 * length)) return false;
    frame->id = (uint16_t)(digits[0] << 8 | digits[1] << 4 | digits[2]);
    frame->fd = false, frame->length = (uint8_t)length;
    for (int i = 0; i < length; ++i) frame->data[i] = (uint8_t)(digits[4 + 2 * i] << 4 | digits[5 + 2 * i]);
    return frame->id < 0x800;
}

enum can_result slcan_receive(struct can_bus *bus, struct can_frame_bytes *frame) {
    for (;;) {
        char *const begin = bus->line + bus->begin;
        char *const stop = memchr(begin, '\r', bus->end - bus->begin);
        if (stop != NULL) {
            bus->begin += (size_t)(stop - begin) + 1;
            if (parse(begin, (size_t)(stop - begin), frame)) return CAN_FRAME;
            continue; /* z acknowledges a frame of ours */
        }
        memmove(bus->line, begin, bus->end - bus->begin);
        bus->end -= bus->begin, bus->begin = 0;
        if (bus->end == sizeof bus->line) bus->end = 0; /* no line is that long */
        const ssize_t n = recv(bus->fd, bus->line + bus->end, sizeof bus->line - bus->end, MSG_DONTWAIT);
        if (n < 0 && errno == EINTR) continue;
        if (n < 0 && (errno == EAGAIN || errno == EWOULDBLOCK)) return CAN_NOTHING;
        if (n <= 0) return CAN_CLOSED;
        bus->end += (size_t)n;
    }
}

bool slcan_send(struct can_bus *bus, const struct can_frame_bytes *frame) {
    char line[32];
    int n = snprintf(line, sizeof line, "t%03X%u", (unsigned)frame->id, (unsigned)frame->length);
    for (int i = 0; i < frame->length; ++i)
        n += snprintf(line + n, sizeof line - (size_t)n, "%02X", (unsigned)frame->data[i]);
    line[n++] = '\r';
    return send_all(bus->fd, line, (size_t)n);
}

void slcan_leave(struct can_bus *bus) { send_all(bus->fd, "C\r", 2); }
