/* A V4L2 capture device, by memory-mapped streaming. A v4l2loopback is a capture device only while narpa writes to it,
 * so opening it is tried again until it streams. */
#include <errno.h>
#include <fcntl.h>
#include <linux/videodev2.h>
#include <stdio.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <unistd.h>

#include "events.h"
#include "exit_status.h"
#include "frame_input.h"

enum { BUFFERS = 4 };
static const double kTryAgain_s = 0.05;

static char path[64];
static int fd = -1;
static int width, height;
static int64_t t_tried_ns;
static bool told_of_others, has_first;
static uint32_t first; /* sequence number of the first frame */
static struct {
    void *at;
    size_t bytes;
} buffers[BUFFERS];

static int control(unsigned long request, void *argument) {
    int status;
    do status = ioctl(fd, request, argument);
    while (status < 0 && errno == EINTR);
    return status;
}

static struct v4l2_buffer buffer_of(uint32_t index) {
    struct v4l2_buffer buffer;
    memset(&buffer, 0, sizeof buffer);
    buffer.type = V4L2_BUF_TYPE_VIDEO_CAPTURE, buffer.memory = V4L2_MEMORY_MMAP, buffer.index = index;
    return buffer;
}

static void stop(void) {
    for (int i = 0; i < BUFFERS; ++i)
        if (buffers[i].at != NULL) munmap(buffers[i].at, buffers[i].bytes), buffers[i].at = NULL;
    if (fd >= 0) close(fd);
    fd = -1;
}

/* False: it does not stream yet, or not what is expected. */
static bool start(void) {
    fd = open(path, O_RDWR | O_NONBLOCK | O_CLOEXEC);
    if (fd < 0) return false;
    struct v4l2_format format;
    memset(&format, 0, sizeof format);
    format.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
    if (control(VIDIOC_G_FMT, &format) < 0 || format.fmt.pix.width == 0) return false;
    const struct v4l2_pix_format *pix = &format.fmt.pix;
    if (pix->pixelformat != V4L2_PIX_FMT_GREY || pix->width != (uint32_t)width || pix->height != (uint32_t)height ||
        pix->bytesperline != (uint32_t)width) {
        if (!told_of_others)
            event(EVENT_ERROR, "%s has frames of %u x %u %.4s, expected %d x %d GREY", path, pix->width, pix->height,
                  (const char *)&pix->pixelformat, width, height);
        told_of_others = true;
        return false;
    }
    struct v4l2_requestbuffers request = {
        .count = BUFFERS, .type = V4L2_BUF_TYPE_VIDEO_CAPTURE, .memory = V4L2_MEMORY_MMAP};
    if (control(VIDIOC_REQBUFS, &request) < 0 || request.count == 0) return false;
    for (uint32_t i = 0; i < request.count && i < BUFFERS; ++i) {
        struct v4l2_buffer buffer = buffer_of(i);
        if (control(VIDIOC_QUERYBUF, &buffer) < 0) return false;
        void *at = mmap(NULL, buffer.length, PROT_READ | PROT_WRITE, MAP_SHARED, fd, (off_t)buffer.m.offset);
        if (at == MAP_FAILED) return false;
        buffers[i].at = at, buffers[i].bytes = buffer.length;
        if (control(VIDIOC_QBUF, &buffer) < 0) return false;
    }
    int type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
    return control(VIDIOC_STREAMON, &type) == 0;
}

/* v4l2loopback hands a new reader the last frame, which may be one of an earlier run, as long as any program has had
 * the device open since. */
static bool drop_old_frames(void) {
    struct v4l2_buffer buffer = buffer_of(0);
    while (control(VIDIOC_DQBUF, &buffer) == 0)
        if (control(VIDIOC_QBUF, &buffer) < 0) return false;
    return errno == EAGAIN;
}

/* Begins to stream if the device can. */
static bool try_to_start(void) {
    t_tried_ns = monotonic_ns(), has_first = false;
    if (start() && drop_old_frames()) return true;
    stop();
    return false;
}

static int v4l2_open(const char *text, const struct camera_table *camera) {
    width = camera->width, height = camera->height;
    snprintf(path, sizeof path, "%s", text);
    const int there = open(path, O_RDWR | O_NONBLOCK | O_CLOEXEC);
    if (there < 0) {
        event(EVENT_ERROR, "--video %s: %s", text, strerror(errno));
        return EXIT_NO_DEVICE;
    }
    close(there);
    try_to_start(); /* before the program says that it is ready: no frame is missed */
    return 0;
}

static bool v4l2_receive(struct frame *out) {
    if (fd < 0) {
        if (monotonic_ns() - t_tried_ns < (int64_t)(kTryAgain_s * 1e9)) return false;
        if (!try_to_start()) return false;
    }
    struct v4l2_buffer buffer = buffer_of(0);
    if (control(VIDIOC_DQBUF, &buffer) < 0) {
        if (errno != EAGAIN) stop(); /* its writer has gone */
        return false;
    }
    const size_t bytes = (size_t)width * (size_t)height;
    const bool whole = buffer.index < BUFFERS && buffer.bytesused == bytes && bytes <= buffers[buffer.index].bytes;
    if (!has_first) has_first = true, first = buffer.sequence;
    if (whole) {
        memcpy(out->pixels, buffers[buffer.index].at, bytes);
        out->is_timed = false, out->number = buffer.sequence - first;
    }
    if (control(VIDIOC_QBUF, &buffer) < 0) stop();
    return whole;
}

static int v4l2_fd(void) { return fd; }

const struct frame_source v4l2_source = {v4l2_open, v4l2_fd, v4l2_receive, NULL};
