/* events.h - what a person should know: a line on standard output. (cFS: CFE_EVS_SendEvent; F': EVENT ports.) */
#ifndef EVENTS_H
#define EVENTS_H

#include <stdint.h>

enum event_level { EVENT_INFO, EVENT_WARNING, EVENT_ERROR };

/* The time of the events that follow: that of the emulator's clock, s. */
void events_time(double t_s);
__attribute__((format(printf, 2, 3))) void event(enum event_level level, const char *format, ...);

int64_t monotonic_ns(void); /* CLOCK_MONOTONIC */

#endif
