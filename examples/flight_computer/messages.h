/* messages.h - the messages on CAN, as tables: bytes to and from the values of their signals.
 *
 * A set of signals is one message: on classic CAN `frames` frames at base + 0, 1, ..., each with 48 bits of payload,
 * the set's counter and a CRC-8; on CAN FD one frame at base + 15 with the counter and a CRC-16
 * (protocols/can/README.md). (cFS: message identifiers and structures; F': ports and their serialised arguments.) */
#ifndef MESSAGES_H
#define MESSAGES_H

#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>

#include "can_bus.h"

enum set_id {
    SET_HEARTBEAT,    /* narpa: its clock */
    SET_LEDGER,       /* narpa: a frame of the camera */
    SET_ATTITUDE,     /* dynamics: star tracker and gyroscope, once a control period */
    SET_DYNAMICS,     /* dynamics: flying, captured ... */
    SET_ACTUATOR,     /* this computer: impulses of the thrusters */
    SET_NAVIGATION,   /* this computer: its estimate */
    SET_HOUSEKEEPING, /* this computer: mode and counts; not one of narpa's */
    SETS
};

/* The signals of each set, in SI units but for times: ns, of the heartbeat us. */
enum { HEARTBEAT_TIME, HEARTBEAT_STATE, HEARTBEAT_SIGNALS };
enum { LEDGER_FRAME, LEDGER_EXPOSURE_MID, LEDGER_DELIVERY, LEDGER_SIGNALS };
enum {
    ATTITUDE_TIME,
    ATTITUDE_ATTITUDE_W,
    ATTITUDE_ATTITUDE_X,
    ATTITUDE_ATTITUDE_Y,
    ATTITUDE_ATTITUDE_Z,
    ATTITUDE_RATE_X,
    ATTITUDE_RATE_Y,
    ATTITUDE_RATE_Z,
    ATTITUDE_SIGNALS
};
enum { DYNAMICS_TIME, DYNAMICS_START, DYNAMICS_PHASE, DYNAMICS_SIGNALS };
enum {
    ACTUATOR_TIME,
    ACTUATOR_IMPULSE_X,
    ACTUATOR_IMPULSE_Y,
    ACTUATOR_IMPULSE_Z,
    ACTUATOR_ANGULAR_IMPULSE_X,
    ACTUATOR_ANGULAR_IMPULSE_Y,
    ACTUATOR_ANGULAR_IMPULSE_Z,
    ACTUATOR_LEG,
    ACTUATOR_PHASE,
    ACTUATOR_ABORT,
    ACTUATOR_SIGNALS
};
enum {
    NAVIGATION_TIME,
    NAVIGATION_POSITION_X,
    NAVIGATION_POSITION_Y,
    NAVIGATION_POSITION_Z,
    NAVIGATION_ATTITUDE_W,
    NAVIGATION_ATTITUDE_X,
    NAVIGATION_ATTITUDE_Y,
    NAVIGATION_ATTITUDE_Z,
    NAVIGATION_SIGMA_X,
    NAVIGATION_SIGMA_Y,
    NAVIGATION_SIGMA_Z,
    NAVIGATION_SIGMA_ROT_X,
    NAVIGATION_SIGMA_ROT_Y,
    NAVIGATION_SIGMA_ROT_Z,
    NAVIGATION_CYCLE,
    NAVIGATION_FRAMES,
    NAVIGATION_SWEEPS,
    NAVIGATION_SIGNALS
};
enum { HOUSEKEEPING_MODE, HOUSEKEEPING_LAMPS, HOUSEKEEPING_FRAMES, HOUSEKEEPING_LOST, HOUSEKEEPING_SIGNALS };
enum { SIGNALS_MAX = NAVIGATION_SIGNALS };

enum { HEARTBEAT_STARTING, HEARTBEAT_RUNNING, HEARTBEAT_LOCKSTEP, HEARTBEAT_STOPPING };
enum { DELIVERY_FRAME, DELIVERY_NOTHING, DELIVERY_REPEATED, DELIVERY_BLANK };
enum { DYNAMICS_FLYING, DYNAMICS_CAPTURED, DYNAMICS_BOUNCED, DYNAMICS_FINISHED };
enum phase { PHASE_MOVING, PHASE_HOLDING, PHASE_CLOSING, PHASE_DOCKED, PHASE_RETREATING, PHASE_DONE };
enum abort_reason { ABORT_NONE, ABORT_LOST, ABORT_UNCERTAIN, ABORT_OFF_REFERENCE, ABORT_BOUNCED };

struct set_values {
    enum set_id id;
    double value[SIGNALS_MAX]; /* by the enumerations above */
};

/* What has arrived of each set. Zeroed at first. */
struct message_decoder {
    uint8_t ledger_camera; /* whose ledgers are read */
    struct {
        uint32_t frames; /* a bit for each that has come */
        uint8_t counter;
        int64_t raw[SIGNALS_MAX];
    } set[SETS];
    uint64_t bad, incomplete; /* frames with a wrong checksum or length; sets that lacked frames */
};

/* True if the frame completes a set, which is then in `out`. Sets with a value that is not available are dropped. */
bool messages_accept(struct message_decoder *decoder, const struct can_frame_bytes *frame, struct set_values *out);

/* Encodes a set, for CAN FD or as classic frames; returns how many frames. Values saturate at what their bits can hold.
 */
enum { FRAMES_OF_SET_MAX = 10 };
int messages_encode(const struct set_values *in, uint8_t counter, bool fd,
                    struct can_frame_bytes out[FRAMES_OF_SET_MAX]);

/* Prints the tables: a line for each signal. A test compares them with protocols/can/narpa.dbc. */
void messages_print(FILE *out);

#endif
