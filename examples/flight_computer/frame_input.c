#include "frame_input.h"

#include <stddef.h>
#include <string.h>

#include "checksums.h"
#include "events.h"
#include "exit_status.h"
#include "little_endian.h"

enum { LINE_BYTES = 160, LINE_T_MID = 96, LINE_CRC = 156 };

static const struct frame_source *source;
static size_t row_bytes, rows;

int frame_input_open(const char *text, const struct camera_table *camera) {
    row_bytes = (size_t)camera->width, rows = (size_t)camera->height;
    if (row_bytes * rows > IMAGE_BYTES_MAX) {
        event(EVENT_ERROR, "frames of %d x %d pixels are too large: see IMAGE_BYTES_MAX", camera->width,
              camera->height);
        return EXIT_BAD_INPUT;
    }
    source = strncmp(text, "udp:", 4) == 0          ? &udp_source
             : strncmp(text, "/dev/video", 10) == 0 ? &v4l2_source
                                                    : &y4m_source;
    return source->open(text, camera);
}

int frame_input_fd(void) { return source->fd(); }
uint64_t frame_input_datagrams_lost(void) { return source->datagrams_lost != NULL ? source->datagrams_lost() : 0; }

/* A scene with `embedded_line = true` has the time of the frame in its last row (protocols/video/README.md). */
static void read_embedded_line(struct frame *frame) {
    const uint8_t *line = frame->pixels + row_bytes * (rows - 1);
    if (row_bytes < LINE_BYTES || memcmp(line, "NRPA\x03\xA0", 6) != 0) return;
    if (crc32(line, LINE_CRC, 0) != u32_at(line + LINE_CRC)) return;
    frame->is_timed = true, frame->t_ns = i64_at(line + LINE_T_MID);
}

bool frame_input_receive(struct frame *out) {
    if (!source->receive(out)) return false;
    out->arrived_ns = monotonic_ns();
    if (!out->is_timed) read_embedded_line(out);
    return true;
}
