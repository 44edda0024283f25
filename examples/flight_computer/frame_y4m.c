/* Y4M (YUV4MPEG2) by a FIFO, as `narpa rehearse` passes frames where no --video is given: a header line, then for each
 * frame a line FRAME and its bytes. */
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "events.h"
#include "exit_status.h"
#include "frame_input.h"

static int fd = -1;
static size_t frame_bytes;
static int width, height;
static bool has_header, in_frame;
static char line[256];
static size_t line_bytes, have;
static uint64_t frames;
static uint8_t pixels[IMAGE_BYTES_MAX];

static int y4m_open(const char *text, const struct camera_table *camera) {
    struct stat what;
    width = camera->width, height = camera->height, frame_bytes = (size_t)width * (size_t)height;
    /* For reading and writing: opening a FIFO for reading only waits until narpa opens it too. */
    fd = open(text, O_RDWR | O_NONBLOCK | O_CLOEXEC);
    if (fd < 0 || fstat(fd, &what) != 0) {
        event(EVENT_ERROR, "--video %s: %s; expected udp:PORT, /dev/videoN or a FIFO", text, strerror(errno));
        return EXIT_NO_DEVICE;
    }
    if (!S_ISFIFO(what.st_mode)) {
        event(EVENT_ERROR, "--video %s: not a FIFO; expected udp:PORT, /dev/videoN or a FIFO", text);
        return EXIT_BAD_INPUT;
    }
    return 0;
}

/* Reads up to the end of a line into `line`; false: it has not all come. */
static bool read_line(void) {
    char c;
    while (read(fd, &c, 1) == 1) {
        if (c == '\n') {
            line[line_bytes] = '\0', line_bytes = 0;
            return true;
        }
        if (line_bytes + 1 < sizeof line) line[line_bytes++] = c;
    }
    return false;
}

static void check_header(void) {
    char expected[64];
    snprintf(expected, sizeof expected, "YUV4MPEG2 W%d H%d ", width, height);
    if (strncmp(line, expected, strlen(expected)) != 0 || strstr(line, " Cmono") == NULL ||
        strstr(line, " Cmono1") != NULL)
        event(EVENT_ERROR, "a stream \"%s\", expected \"%s... Cmono\" (GREY)", line, expected);
    else
        has_header = true;
}

static bool y4m_receive(struct frame *out) {
    for (;;) {
        if (!in_frame) {
            if (!read_line()) return false;
            if (has_header && strncmp(line, "FRAME", 5) == 0)
                in_frame = true, have = 0;
            else
                check_header();
            continue;
        }
        const ssize_t n = read(fd, pixels + have, frame_bytes - have);
        if (n < 0 && errno == EINTR) continue;
        if (n <= 0) return false;
        have += (size_t)n;
        if (have < frame_bytes) continue;
        in_frame = false;
        memcpy(out->pixels, pixels, frame_bytes);
        out->is_timed = false, out->number = frames++;
        return true;
    }
}

static int y4m_fd(void) { return fd; }

const struct frame_source y4m_source = {y4m_open, y4m_fd, y4m_receive, NULL};
