/* frame_input.h - frames of the camera: UDP datagrams, a V4L2 device, or Y4M by a FIFO. (cFS: an I/O application, with
 * the pixels in shared memory; F': a driver component and Fw::Buffer.) */
#ifndef FRAME_INPUT_H
#define FRAME_INPUT_H

#include <stdbool.h>
#include <stdint.h>

#include "mission.h"

struct frame {
    int64_t arrived_ns; /* CLOCK_MONOTONIC */
    bool is_timed;
    int64_t t_ns;                    /* if it is: middle of the exposure, clock of the emulator */
    uint64_t number;                 /* unless it is: place in the stream from 0, lost frames included */
    uint8_t pixels[IMAGE_BYTES_MAX]; /* GREY, rows from the top */
};

struct frame_input; /* there is one */

/* `text`: udp:PORT, udp:HOST:PORT as in narpa's --video, /dev/videoN, or the path of a FIFO. Returns an exit status
 * after it has printed the reason, or 0. */
int frame_input_open(const char *text, const struct camera_table *camera);
int frame_input_fd(void); /* to wait for with poll(); -1: none yet */
/* The next whole frame, if there is one; else `out` is unchanged. Does not wait. Reports and counts frames that lack
 * datagrams. */
bool frame_input_receive(struct frame *out);
uint64_t frame_input_datagrams_lost(void);

/* The three kinds. `open` returns like frame_input_open. */
struct frame_source {
    int (*open)(const char *text, const struct camera_table *camera);
    int (*fd)(void);
    bool (*receive)(struct frame *out);
    uint64_t (*datagrams_lost)(void); /* or NULL */
};
extern const struct frame_source udp_source, v4l2_source, y4m_source;

#endif
