/* modes.h - the state machine: a table of modes, and one of the transitions between them. (cFS: the application's own
 * table; F': a state machine of FPP.) */
#ifndef MODES_H
#define MODES_H

#include <stdbool.h>
#include <stdint.h>

#include "messages.h"

enum mode {
    MODE_BOOT,
    MODE_WAIT,
    MODE_ACQUIRE,
    MODE_APPROACH,
    MODE_CLOSING,
    MODE_DOCKED,
    MODE_ABORT,
    MODE_SAFE,
    MODES
};

/* What the chaser does in a mode. */
enum control { CONTROL_OFF, CONTROL_HOLD, CONTROL_LEGS, CONTROL_RETREAT };

struct mode_row {
    const char *name;
    enum control control;
    enum phase phase;  /* on CAN, in the actuator command */
    uint8_t heartbeat; /* on CAN: the state of CiA 301's heartbeat */
    bool sends_estimates;
};
extern const struct mode_row mode_table[MODES];

/* What transitions are decided by. */
struct status {
    bool has_bus, has_reports; /* the bus is open; the dynamics have reported */
    int fixes;                 /* last cycles in a row that found lamps */
    double since_fix_s;        /* since the last one, or since the first report */
    double sigma_m, off_m;     /* largest standard deviation of the position; distance from the reference */
    double range_m;            /* between the ports */
    bool on_contact_leg;
    int dynamics_phase;
    double silence_s; /* since the last attitude report */
};

struct machine {
    enum mode mode;
    enum abort_reason abort; /* kept once there is one */
};

/* Follows the first transition whose condition holds; true: the mode has changed. */
bool machine_step(struct machine *machine, const struct status *status);

#endif
