/* can_bus.h - CAN frames in and out: SocketCAN, or slcan over TCP to narpa's hub. (cFS: an I/O application; F': a
 * driver component.) */
#ifndef CAN_BUS_H
#define CAN_BUS_H

#include <signal.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

struct can_frame_bytes {
    uint16_t id; /* 11 bits */
    bool fd;
    uint8_t length;
    uint8_t data[64];
};

struct can_bus {
    int fd;
    bool is_slcan, carries_fd;
    uint64_t sent, unsent; /* frames */
    char line[4096];       /* slcan: received, not yet read */
    size_t begin, end;
};

/* `name`: an interface of SocketCAN such as can0, or slcan:HOST:PORT. Retries for `patience_s` while there is no such
 * bus yet. On failure prints the reason and returns an exit status, else 0. */
int can_bus_open(struct can_bus *bus, const char *name, double patience_s, const volatile sig_atomic_t *stop);

enum can_result { CAN_FRAME, CAN_NOTHING, CAN_CLOSED };
enum can_result can_bus_receive(struct can_bus *bus, struct can_frame_bytes *frame); /* does not wait */
bool can_bus_send(struct can_bus *bus, const struct can_frame_bytes *frame);
void can_bus_close(struct can_bus *bus);

/* can_slcan.c, can_socket.c: one attempt to open; a message of the reason, or NULL. */
const char *slcan_open(struct can_bus *bus, const char *host, const char *port);
enum can_result slcan_receive(struct can_bus *bus, struct can_frame_bytes *frame);
bool slcan_send(struct can_bus *bus, const struct can_frame_bytes *frame);
void slcan_leave(struct can_bus *bus);
const char *socketcan_open(struct can_bus *bus, const char *interface);
enum can_result socketcan_receive(struct can_bus *bus, struct can_frame_bytes *frame);
bool socketcan_send(struct can_bus *bus, const struct can_frame_bytes *frame);

#endif
