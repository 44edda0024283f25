/* app.h - the application: waits for messages and frames, and answers each attitude report with an estimate and a
 * command. */
#ifndef APP_H
#define APP_H

#include <signal.h>

struct app_options {
    const char *can, *video; /* can_bus.h, frame_input.h */
    volatile sig_atomic_t *stop;
};

/* Returns the exit status. */
int app_run(const struct app_options *options);

#endif
