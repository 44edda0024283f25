#include "modes.h"

#include "events.h"
#include "mission.h"

enum { PREOPERATIONAL = 0x7F, OPERATIONAL = 0x05, STOPPED = 0x04 };
enum { FIXES_TO_START = 3 };
static const double kLostHold_s = 5, kSilence_s = 3, kRetreated_m = 20;

const struct mode_row mode_table[MODES] = {
    [MODE_BOOT] = {"boot", CONTROL_OFF, PHASE_HOLDING, PREOPERATIONAL, false},
    [MODE_WAIT] = {"wait for the target", CONTROL_OFF, PHASE_HOLDING, PREOPERATIONAL, false},
    [MODE_ACQUIRE] = {"acquire", CONTROL_HOLD, PHASE_HOLDING, OPERATIONAL, true},
    [MODE_APPROACH] = {"approach", CONTROL_LEGS, PHASE_MOVING, OPERATIONAL, true},
    [MODE_CLOSING] = {"closing", CONTROL_LEGS, PHASE_CLOSING, OPERATIONAL, true},
    [MODE_DOCKED] = {"docked", CONTROL_OFF, PHASE_DOCKED, OPERATIONAL, false},
    [MODE_ABORT] = {"abort", CONTROL_RETREAT, PHASE_RETREATING, OPERATIONAL, true},
    [MODE_SAFE] = {"safe", CONTROL_OFF, PHASE_DONE, STOPPED, false},
};

static bool bus_is_open(const struct status *s) { return s->has_bus; }
static bool target_is_there(const struct status *s) { return s->has_reports; }
static bool lamps_are_found(const struct status *s) { return s->fixes >= FIXES_TO_START; }
static bool lamps_are_missing(const struct status *s) { return s->since_fix_s > kLostHold_s; }
static bool last_leg_begins(const struct status *s) { return s->on_contact_leg; }
static bool is_captured(const struct status *s) { return s->dynamics_phase == DYNAMICS_CAPTURED; }
static bool has_bounced(const struct status *s) { return s->dynamics_phase == DYNAMICS_BOUNCED; }
static bool is_lost(const struct status *s) { return s->since_fix_s > mission.abort_lost_s; }
static bool is_uncertain(const struct status *s) { return s->sigma_m > mission.abort_sigma_m; }
static bool is_off_reference(const struct status *s) { return s->off_m > mission.abort_off_m; }
static bool has_retreated(const struct status *s) { return s->range_m > kRetreated_m; }
static bool sensors_are_silent(const struct status *s) { return s->silence_s > kSilence_s; }

#define IN(mode) (1u << (mode))
#define FLYING (IN(MODE_ACQUIRE) | IN(MODE_APPROACH) | IN(MODE_CLOSING))

/* The first row that applies is followed. */
static const struct transition {
    unsigned from; /* modes */
    bool (*when)(const struct status *);
    enum mode to;
    enum abort_reason abort;
    const char *why;
} transitions[] = {
    {IN(MODE_BOOT), bus_is_open, MODE_WAIT, ABORT_NONE, "the bus is open"},
    {IN(MODE_WAIT), target_is_there, MODE_ACQUIRE, ABORT_NONE, "the dynamics report"},
    {FLYING, is_captured, MODE_DOCKED, ABORT_NONE, "the port has captured the chaser"},
    {FLYING, has_bounced, MODE_ABORT, ABORT_BOUNCED, "the chaser has bounced off"},
    {FLYING, is_lost, MODE_ABORT, ABORT_LOST, "no lamps for too long"},
    {FLYING, is_uncertain, MODE_ABORT, ABORT_UNCERTAIN, "the estimate is too uncertain"},
    {FLYING, is_off_reference, MODE_ABORT, ABORT_OFF_REFERENCE, "too far from the reference"},
    {FLYING | IN(MODE_ABORT), sensors_are_silent, MODE_SAFE, ABORT_LOST, "no attitude report"},
    {IN(MODE_ABORT), has_retreated, MODE_SAFE, ABORT_NONE, "the retreat is over"},
    {IN(MODE_ACQUIRE), lamps_are_found, MODE_APPROACH, ABORT_NONE, "lamps are found"},
    {IN(MODE_APPROACH), lamps_are_missing, MODE_ACQUIRE, ABORT_NONE, "no lamps: hold"},
    {IN(MODE_APPROACH), last_leg_begins, MODE_CLOSING, ABORT_NONE, "the last leg begins"},
};

bool machine_step(struct machine *machine, const struct status *status) {
    for (unsigned i = 0; i < sizeof transitions / sizeof transitions[0]; ++i) {
        const struct transition *t = &transitions[i];
        if ((t->from & IN(machine->mode)) == 0 || !t->when(status)) continue;
        event(t->abort != ABORT_NONE ? EVENT_WARNING : EVENT_INFO, "%s -> %s: %s", mode_table[machine->mode].name,
              mode_table[t->to].name, t->why);
        machine->mode = t->to;
        if (machine->abort == ABORT_NONE) machine->abort = t->abort;
        return true;
    }
    return false;
}
