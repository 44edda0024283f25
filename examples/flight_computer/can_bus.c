#include "can_bus.h"

#include <stdio.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "events.h"
#include "exit_status.h"

int can_bus_open(struct can_bus *bus, const char *name, double patience_s, const volatile sig_atomic_t *stop) {
    char host[256] = "";
    const char *port = NULL;
    memset(bus, 0, sizeof *bus);
    bus->is_slcan = strncmp(name, "slcan:", 6) == 0;
    if (bus->is_slcan) {
        const char *address = name + 6, *colon = strrchr(address, ':');
        port = colon != NULL ? colon + 1 : address; /* without a host: this machine */
        snprintf(host, sizeof host, "%.*s", colon != NULL ? (int)(colon - address) : 9,
                 colon != NULL ? address : "127.0.0.1");
        if (host[0] == '\0' || port[0] == '\0' || strspn(port, "0123456789") != strlen(port)) {
            event(EVENT_ERROR, "--can %s: expected slcan:HOST:PORT, or an interface such as can0", name);
            return EXIT_BAD_INPUT;
        }
    } else if (name[0] == '\0' || strchr(name, ':') != NULL) {
        event(EVENT_ERROR, "--can %s: expected slcan:HOST:PORT, or an interface such as can0", name);
        return EXIT_BAD_INPUT;
    }
    const int64_t until_ns = monotonic_ns() + (int64_t)(patience_s * 1e9);
    bool said = false;
    for (;;) {
        const char *trouble = bus->is_slcan ? slcan_open(bus, host, port) : socketcan_open(bus, name);
        if (trouble == NULL) return 0;
        if (*stop || monotonic_ns() > until_ns) {
            event(EVENT_ERROR, "--can %s: %s", name, trouble);
            return EXIT_NO_DEVICE;
        }
        if (!said) event(EVENT_INFO, "--can %s: %s; tries again for %g s", name, trouble, patience_s);
        said = true;
        nanosleep(&(struct timespec){.tv_nsec = 100000000}, NULL);
    }
}

enum can_result can_bus_receive(struct can_bus *bus, struct can_frame_bytes *frame) {
    return bus->is_slcan ? slcan_receive(bus, frame) : socketcan_receive(bus, frame);
}

bool can_bus_send(struct can_bus *bus, const struct can_frame_bytes *frame) {
    const bool taken = bus->is_slcan ? slcan_send(bus, frame) : socketcan_send(bus, frame);
    ++*(taken ? &bus->sent : &bus->unsent);
    return taken;
}

void can_bus_close(struct can_bus *bus) {
    if (bus->is_slcan) slcan_leave(bus);
    close(bus->fd);
}
