#include "events.h"

#include <stdarg.h>
#include <stdio.h>
#include <time.h>

static double now_s;

void events_time(double t_s) { now_s = t_s; }

void event(enum event_level level, const char *format, ...) {
    static const char *const names[] = {"", "warning: ", "error: "};
    va_list arguments;
    va_start(arguments, format);
    printf("%9.3f s  %s", now_s, names[level]);
    vprintf(format, arguments);
    putchar('\n');
    fflush(stdout);
    va_end(arguments);
}

int64_t monotonic_ns(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (int64_t)t.tv_sec * 1000000000 + t.tv_nsec;
}
