/* Docks the scenario of mission.c by the lamps around the port. README.md says how to build and to fly it. */
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "app.h"
#include "exit_status.h"
#include "messages.h"
#include "mission.h"

static const char usage[] =
    "usage: flight_computer [--can BUS] [--video SOURCE]\n"
    "       flight_computer --messages\n"
    "\n"
    "  --can BUS       can0 (SocketCAN), or slcan:[HOST:]PORT; default: $BUS\n"
    "  --video SOURCE  udp:PORT, /dev/videoN or a FIFO of Y4M; default: $VIDEO, also as CAMERA=SOURCE\n"
    "  --messages      prints the tables of CAN messages and ends\n"
    "\n"
    "Exit status: 0 the run has ended, 1 failed, 2 bad arguments, 3 a device is missing.\n";

static volatile sig_atomic_t stop;

static void on_signal(int number) {
    (void)number;
    stop = 1;
}

static int wrong(const char *what, const char *argument) {
    fprintf(stderr, "flight_computer: %s %s\n\n%s", what, argument, usage);
    return EXIT_BAD_INPUT;
}

/* The source of the mission's camera in a text such as "nav=out/nav.fifo aft=udp:5005", or the whole text without '='.
 */
static const char *source_of_camera(const char *text) {
    static char source[4096];
    const size_t name = strlen(mission.camera.name);
    if (strchr(text, '=') == NULL || text[0] == '/' || strncmp(text, "udp:", 4) == 0) return text;
    for (const char *at = text; *at != '\0'; at += strspn(at, " ")) {
        const size_t n = strcspn(at, " ");
        if (strncmp(at, mission.camera.name, name) == 0 && at[name] == '=') {
            snprintf(source, sizeof source, "%.*s", (int)(n - name - 1), at + name + 1);
            return source;
        }
        at += n;
    }
    return NULL;
}

int main(int argc, char **argv) {
    struct app_options options = {.can = getenv("BUS"), .video = getenv("VIDEO"), .stop = &stop};
    for (int i = 1; i < argc; ++i) {
        const bool has_value = i + 1 < argc;
        if (strcmp(argv[i], "--help") == 0) return fputs(usage, stdout), 0;
        if (strcmp(argv[i], "--messages") == 0) return messages_print(stdout), 0;
        if (strcmp(argv[i], "--can") != 0 && strcmp(argv[i], "--video") != 0) return wrong("unknown argument", argv[i]);
        if (!has_value) return wrong("no value after", argv[i]);
        *(strcmp(argv[i], "--can") == 0 ? &options.can : &options.video) = argv[i + 1];
        ++i;
    }
    if (options.can == NULL || options.can[0] == '\0') return wrong("no bus:", "give --can");
    if (options.video == NULL || options.video[0] == '\0') return wrong("no frames:", "give --video");
    const char *source = source_of_camera(options.video);
    if (source == NULL) return wrong("no source of the camera in", options.video);
    options.video = source;

    signal(SIGPIPE, SIG_IGN);
    signal(SIGINT, on_signal);
    signal(SIGTERM, on_signal);
    return app_run(&options);
}
