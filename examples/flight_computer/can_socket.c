/* SocketCAN: CAN FD where the interface's MTU is that of CAN FD or more, else classic frames. */
#include <errno.h>
#include <linux/can.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <unistd.h>

#include "can_bus.h"

const char *socketcan_open(struct can_bus *bus, const char *interface) {
    struct ifreq request;
    if (strlen(interface) >= sizeof request.ifr_name) return "the name of an interface is shorter";
    const int fd = socket(PF_CAN, SOCK_RAW, CAN_RAW);
    if (fd < 0) return errno == EAFNOSUPPORT ? "this kernel has no CAN" : strerror(errno);
    memset(&request, 0, sizeof request);
    strcpy(request.ifr_name, interface);
    const char *trouble = NULL;
    struct sockaddr_can address = {.can_family = AF_CAN};
    if (ioctl(fd, SIOCGIFMTU, &request) < 0) {
        trouble = strerror(errno);
    } else {
        const int on = 1;
        bus->carries_fd = request.ifr_mtu >= (int)CANFD_MTU;
        setsockopt(fd, SOL_CAN_RAW, CAN_RAW_FD_FRAMES, &on, sizeof on); /* to receive them */
        if (ioctl(fd, SIOCGIFINDEX, &request) < 0) trouble = strerror(errno);
        address.can_ifindex = request.ifr_ifindex;
        if (trouble == NULL && ioctl(fd, SIOCGIFFLAGS, &request) < 0) trouble = strerror(errno);
        if (trouble == NULL && (request.ifr_flags & IFF_UP) == 0) trouble = "the interface is down";
        if (trouble == NULL && bind(fd, (const struct sockaddr *)&address, sizeof address) < 0)
            trouble = strerror(errno);
    }
    if (trouble != NULL)
        close(fd);
    else
        bus->fd = fd;
    return trouble;
}

enum can_result socketcan_receive(struct can_bus *bus, struct can_frame_bytes *frame) {
    for (;;) {
        struct canfd_frame got;
        const ssize_t n = recv(bus->fd, &got, sizeof got, MSG_DONTWAIT);
        if (n < 0 && errno == EINTR) continue;
        if (n < 0) return errno == EAGAIN || errno == EWOULDBLOCK || errno == ENETDOWN ? CAN_NOTHING : CAN_CLOSED;
        if ((n != CAN_MTU && n != CANFD_MTU) || (got.can_id & (CAN_EFF_FLAG | CAN_RTR_FLAG | CAN_ERR_FLAG)) != 0)
            continue;
        if (got.len > (n == CAN_MTU ? 8 : 64)) continue;
        frame->id = (uint16_t)(got.can_id & CAN_SFF_MASK);
        frame->fd = n == CANFD_MTU, frame->length = got.len;
        memcpy(frame->data, got.data, got.len);
        return CAN_FRAME;
    }
}

bool socketcan_send(struct can_bus *bus, const struct can_frame_bytes *frame) {
    struct canfd_frame out;
    memset(&out, 0, sizeof out);
    out.can_id = frame->id, out.len = frame->length;
    memcpy(out.data, frame->data, frame->length);
    const size_t bytes = frame->fd ? CANFD_MTU : CAN_MTU;
    for (int attempt = 0; attempt < 20; ++attempt) { /* the interface's queue may be full for some frames' time */
        /* Without waiting: a bus on which nobody acknowledges frames must not stop the control cycle. */
        if (send(bus->fd, &out, bytes, MSG_DONTWAIT) == (ssize_t)bytes) return true;
        if (errno != ENOBUFS && errno != EAGAIN && errno != EINTR) return false;
        usleep(500);
    }
    return false;
}
