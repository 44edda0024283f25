#include "app.h"

#include <inttypes.h>
#include <math.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>

#include "can_bus.h"
#include "events.h"
#include "exit_status.h"
#include "frame_input.h"
#include "guidance.h"
#include "messages.h"
#include "modes.h"

/* Timing. In real time a command acts a fixed time after the report that it answers, so that the filter knows what the
 * thrusters do; the frame has to have come before. In lockstep it acts at the time of the report. */
static const double kFrameDeadline_s = 0.20, kCommandLead_s = 0.25;
static const double kBusPatience_s = 30, kStartPatience_s = 120, kHeartbeatSilence_s = 10;
static const double kLockstepFrame_s = 10;         /* wall time after which a frame of a lockstep run counts as lost */
static const double kNoFrames_s = 5;               /* until it is reported, and again */
static const int64_t kSameTime_ns = 1000000;       /* a frame is of the report's time if it is as close as this */
static const int64_t kHeartbeatRounding_ns = 1000; /* heartbeats carry microseconds */
enum { POLL_MS = 10, LEDGERS_KEPT = 16, HEARTBEAT_ID = 0x702 };

struct ledger {
    int64_t t_mid_ns, arrived_ns;
    bool is_frame; /* not one that is repeated or blank */
};

static struct app {
    struct can_bus bus;
    struct message_decoder decoder;
    struct machine machine;
    struct filter filter;
    struct guidance guidance;
    struct thrust thrust; /* of the last command */
    bool has_started, is_over, has_failed;

    /* Inputs. */
    int run_state; /* of narpa: HEARTBEAT_... */
    int64_t t_clock_ns, clock_arrived_ns;
    bool has_clock, has_dynamics, has_report, is_answered;
    int dynamics_phase;
    int64_t t_start_ns, t_report_ns, report_arrived_ns, t_cycle_ns;
    struct quat q_WC;
    struct vec3 rate_rad_s;
    struct ledger ledgers[LEDGERS_KEPT];
    uint64_t delivered, received; /* frames: by the ledgers, and here */
    struct frame frame;           /* the newest */
    bool has_frame;

    /* Outputs. */
    struct set_values estimate, actuator;
    uint8_t counters[SETS];
    int64_t t_heartbeat_ns;

    /* Since the start. */
    int fixes, lamps;
    double since_fix_s;
    uint64_t cycles, cycles_with_lamps, cycles_without_frame, commands_late;
    double longest_cycle_s;
    int64_t frame_seen_ns, frame_missed_ns; /* the last one came; its lack was last reported */
} app;

static double seconds_since(int64_t t_ns) { return (double)(monotonic_ns() - t_ns) * 1e-9; }
static bool in_lockstep(void) { return app.run_state == HEARTBEAT_LOCKSTEP; }

/* --- Messages in: a function for each set, and a table --- */

static void on_heartbeat(const struct set_values *m) {
    const int state = (int)m->value[HEARTBEAT_STATE];
    if (state == HEARTBEAT_STARTING) return;
    if (!app.has_clock)
        event(EVENT_INFO, "narpa is there, in %s", state == HEARTBEAT_LOCKSTEP ? "lockstep" : "real time");
    if (state == HEARTBEAT_STOPPING) {
        app.is_over = true, app.has_failed = app.machine.mode != MODE_DOCKED;
        event(app.has_failed ? EVENT_ERROR : EVENT_INFO, "narpa stops");
        return;
    }
    app.run_state = state, app.has_clock = true;
    app.t_clock_ns = (int64_t)m->value[HEARTBEAT_TIME] * 1000, app.clock_arrived_ns = monotonic_ns();
}

static void on_ledger(const struct set_values *m) {
    const int delivery = (int)m->value[LEDGER_DELIVERY];
    if (delivery == DELIVERY_NOTHING) return;
    app.ledgers[app.delivered++ % LEDGERS_KEPT] =
        (struct ledger){(int64_t)m->value[LEDGER_EXPOSURE_MID], monotonic_ns(), delivery == DELIVERY_FRAME};
}

static void on_dynamics(const struct set_values *m) {
    app.has_dynamics = true;
    app.t_start_ns = (int64_t)m->value[DYNAMICS_START], app.dynamics_phase = (int)m->value[DYNAMICS_PHASE];
    if (app.dynamics_phase == DYNAMICS_FINISHED) app.is_over = true;
}

static void on_attitude(const struct set_values *m) {
    const struct quat q = {m->value[ATTITUDE_ATTITUDE_W], m->value[ATTITUDE_ATTITUDE_X], m->value[ATTITUDE_ATTITUDE_Y],
                           m->value[ATTITUDE_ATTITUDE_Z]};
    const int64_t t_ns = (int64_t)m->value[ATTITUDE_TIME];
    if (app.has_report && t_ns <= app.t_report_ns) return;
    app.q_WC = quat_normalised(q);
    app.rate_rad_s = (struct vec3){m->value[ATTITUDE_RATE_X], m->value[ATTITUDE_RATE_Y], m->value[ATTITUDE_RATE_Z]};
    app.t_report_ns = t_ns, app.report_arrived_ns = monotonic_ns();
    app.has_report = true, app.is_answered = false;
}

static const struct {
    enum set_id id;
    void (*handler)(const struct set_values *);
} inbound[] = {
    {SET_HEARTBEAT, on_heartbeat},
    {SET_LEDGER, on_ledger},
    {SET_DYNAMICS, on_dynamics},
    {SET_ATTITUDE, on_attitude},
};

/* Takes all that has come from the bus. */
static void receive_messages(void) {
    struct can_frame_bytes frame;
    struct set_values message;
    enum can_result result;
    while (!app.is_over && (result = can_bus_receive(&app.bus, &frame)) != CAN_NOTHING) {
        if (result == CAN_CLOSED) {
            app.is_over = true, app.has_failed = app.machine.mode != MODE_DOCKED;
            event(app.has_failed ? EVENT_ERROR : EVENT_INFO, "the bus has been closed");
            return;
        }
        if (!messages_accept(&app.decoder, &frame, &message)) continue;
        for (unsigned i = 0; i < sizeof inbound / sizeof inbound[0]; ++i)
            if (inbound[i].id == message.id) inbound[i].handler(&message);
    }
}

/* --- Frames in --- */

/* The time of a frame that does not say it: that of its ledger. In lockstep there is a ledger for each frame of the
 * stream, and a frame may come when it is no longer waited for; in real time it is the ledger that came nearest to the
 * frame. */
static bool time_by_ledger(struct frame *frame) {
    const struct ledger *found = NULL;
    if (in_lockstep()) {
        if (frame->number < app.delivered && app.delivered - frame->number <= LEDGERS_KEPT)
            found = &app.ledgers[frame->number % LEDGERS_KEPT];
    } else {
        int64_t nearest_ns = (int64_t)(0.5e9 / mission.camera.rate_hz);
        for (uint64_t i = 0; i < LEDGERS_KEPT && i < app.delivered; ++i) {
            const int64_t off_ns = llabs(app.ledgers[i].arrived_ns - frame->arrived_ns);
            if (off_ns < nearest_ns) nearest_ns = off_ns, found = &app.ledgers[i];
        }
    }
    if (found == NULL || !found->is_frame) return false;
    frame->is_timed = true, frame->t_ns = found->t_mid_ns;
    return true;
}

/* Takes one frame, if there is one: the cycle looks at it before the next one replaces it. */
static void receive_frame(void) {
    if (!frame_input_receive(&app.frame)) return;
    if (app.frame.is_timed)
        ++app.received;
    else if (app.frame.number >= app.received)
        app.received = app.frame.number + 1;
    app.frame_seen_ns = app.frame.arrived_ns;
    app.has_frame = true;
}

/* The frame exposed at the time of the report has come. */
static bool frame_is_there(void) {
    if (!app.has_frame || (!app.frame.is_timed && !time_by_ledger(&app.frame))) return false;
    return llabs(app.frame.t_ns - app.t_report_ns) < kSameTime_ns;
}

/* --- Messages out: a function that fills each set, and a table --- */

static void put_vector(double *value, struct vec3 v) { value[0] = v.x, value[1] = v.y, value[2] = v.z; }

static void fill_estimate(struct set_values *m) { *m = app.estimate; }
static void fill_actuator(struct set_values *m) { *m = app.actuator; }
static void fill_housekeeping(struct set_values *m) {
    m->value[HOUSEKEEPING_MODE] = app.machine.mode;
    m->value[HOUSEKEEPING_LAMPS] = app.lamps;
    m->value[HOUSEKEEPING_FRAMES] = (double)(app.cycles_with_lamps % 65536);
    m->value[HOUSEKEEPING_LOST] = (double)(frame_input_datagrams_lost() % 65536);
}

static const struct {
    enum set_id id;
    void (*fill)(struct set_values *);
    bool is_estimate; /* sent in modes that estimate */
} outbound[] = {
    /* once a control period, in this order */
    {SET_NAVIGATION, fill_estimate, true},
    {SET_ACTUATOR, fill_actuator, false},
    {SET_HOUSEKEEPING, fill_housekeeping, false},
};

static void send_messages(void) {
    for (unsigned i = 0; i < sizeof outbound / sizeof outbound[0]; ++i) {
        if (outbound[i].is_estimate && !mode_table[app.machine.mode].sends_estimates) continue;
        struct set_values message = {.id = outbound[i].id};
        struct can_frame_bytes frames[FRAMES_OF_SET_MAX];
        outbound[i].fill(&message);
        message.id = outbound[i].id;
        const int n = messages_encode(&message, app.counters[message.id]++, app.bus.carries_fd, frames);
        for (int f = 0; f < n; ++f) can_bus_send(&app.bus, &frames[f]);
    }
}

/* CiA 301: node 2, once a second; in lockstep once a control period. */
static void send_heartbeat(void) {
    const struct can_frame_bytes frame = {
        .id = HEARTBEAT_ID, .length = 1, .data = {mode_table[app.machine.mode].heartbeat}};
    can_bus_send(&app.bus, &frame);
    app.t_heartbeat_ns = monotonic_ns();
}

/* --- The control cycle --- */

static struct status status_now(const struct mat3 *R_LC) {
    const struct vec3 port = guidance_port(&app.filter, R_LC);
    const double(*P)[ERRORS] = app.filter.P;
    return (struct status){
        .has_bus = true,
        .has_reports = true,
        .fixes = app.fixes,
        .since_fix_s = app.since_fix_s,
        .sigma_m = sqrt(fmax(P[0][0], fmax(P[1][1], P[2][2]))),
        .off_m = vec_norm(vec_sub(port, app.guidance.position_m)),
        .range_m = vec_norm(port),
        .on_contact_leg = guidance_is_on_contact_leg(&app.guidance),
        .dynamics_phase = app.dynamics_phase,
    };
}

/* The chaser's attitude in L at the time of the report. */
static struct quat attitude_in_orbit(void) {
    const double t_s = (double)(app.t_report_ns - app.t_start_ns) * 1e-9;
    return quat_product(quat_from_vector((struct vec3){0, -mission.orbit_rate_rad_s * t_s, 0}), app.q_WC);
}

static void make_estimate(struct quat q_LC) {
    const struct estimate e = filter_estimate(&app.filter, q_LC);
    double *value = app.estimate.value;
    value[NAVIGATION_TIME] = (double)app.t_report_ns;
    put_vector(&value[NAVIGATION_POSITION_X], e.position_m);
    value[NAVIGATION_ATTITUDE_W] = e.q_CT.w;
    put_vector(&value[NAVIGATION_ATTITUDE_X], (struct vec3){e.q_CT.x, e.q_CT.y, e.q_CT.z});
    put_vector(&value[NAVIGATION_SIGMA_X], e.sigma_m);
    put_vector(&value[NAVIGATION_SIGMA_ROT_X], e.sigma_rad);
    value[NAVIGATION_CYCLE] = (double)app.cycles, value[NAVIGATION_FRAMES] = app.lamps > 0;
}

static void make_command(struct quat q_LC) {
    const double lead_s = in_lockstep() ? 0 : kCommandLead_s;
    const struct command c =
        guidance_step(&app.guidance, &mode_table[app.machine.mode], &app.filter, q_LC, app.rate_rad_s, lead_s);
    double *value = app.actuator.value;
    value[ACTUATOR_TIME] = (double)(app.t_report_ns + (int64_t)(lead_s * 1e9));
    put_vector(&value[ACTUATOR_IMPULSE_X], c.impulse_n_s);
    put_vector(&value[ACTUATOR_ANGULAR_IMPULSE_X], c.angular_n_m_s);
    value[ACTUATOR_LEG] = app.guidance.leg, value[ACTUATOR_PHASE] = c.phase, value[ACTUATOR_ABORT] = app.machine.abort;
    app.thrust = c.thrust;
}

static void cycle(void) {
    const int64_t t_began_ns = monotonic_ns();
    const bool has_frame = frame_is_there();
    const struct quat q_LC = attitude_in_orbit();
    const struct mat3 R_LC = quat_to_mat(q_LC);
    events_time((double)(app.t_report_ns - app.t_start_ns) * 1e-9);
    if (!app.has_started) {
        filter_start(&app.filter, &R_LC);
        guidance_start(&app.guidance);
        app.has_started = true;
    } else {
        const struct thrust none = {{0, 0, 0}, {0, 0, 0}};
        const long periods = lround((double)(app.t_report_ns - app.t_cycle_ns) * 1e-9 / mission.period_s);
        for (long i = 0; i < periods; ++i) filter_predict(&app.filter, i == 0 ? &app.thrust : &none);
        app.since_fix_s += (double)periods * mission.period_s;
    }
    app.t_cycle_ns = app.t_report_ns;
    app.lamps = has_frame ? filter_update(&app.filter, app.frame.pixels, &R_LC) : 0;
    app.has_frame = false;
    app.fixes = app.lamps > 0 ? app.fixes + 1 : 0;
    if (app.lamps > 0) app.since_fix_s = 0, ++app.cycles_with_lamps;
    app.cycles_without_frame += !has_frame;

    const struct status status = status_now(&R_LC);
    while (machine_step(&app.machine, &status))
        if (app.machine.mode == MODE_ABORT) guidance_retreat(&app.guidance, &app.filter, &R_LC);
    make_estimate(q_LC);
    make_command(q_LC);
    send_messages();
    if (in_lockstep()) send_heartbeat();

    const struct vec3 port = guidance_port(&app.filter, &R_LC);
    event(EVENT_INFO, "%s: %d lamps%s, port at (%.3f, %.3f, %.3f) m", mode_table[app.machine.mode].name, app.lamps,
          has_frame ? "" : " (no frame)", port.x, port.y, port.z);
    ++app.cycles;
    app.is_answered = true;
    app.longest_cycle_s = fmax(app.longest_cycle_s, seconds_since(t_began_ns));
    app.commands_late += !in_lockstep() && seconds_since(app.report_arrived_ns) > kCommandLead_s;
}

/* A report is to be answered, and the frame of its time has come or will not come. */
static bool is_time_for_cycle(void) {
    if (!app.has_clock || !app.has_dynamics || !app.has_report || app.is_answered) return false;
    if (!in_lockstep()) return frame_is_there() || seconds_since(app.report_arrived_ns) > kFrameDeadline_s;
    if (app.t_clock_ns + kHeartbeatRounding_ns < app.t_report_ns) return false;
    if (app.received >= app.delivered) return true;
    if (seconds_since(app.clock_arrived_ns) < kLockstepFrame_s) return false;
    event(EVENT_WARNING, "%" PRIu64 " frames have not come", app.delivered - app.received);
    app.received = app.delivered;
    return true;
}

/* --- What is missing for long --- */

static void check_silence(int64_t t_begin_ns) {
    if (!app.has_clock || !app.has_report) {
        if (seconds_since(t_begin_ns) < kStartPatience_s) return;
        event(EVENT_ERROR, "%s for %g s: are narpa and the dynamics there?",
              app.has_clock ? "no report of the dynamics" : "no heartbeat of narpa", kStartPatience_s);
        app.is_over = app.has_failed = true;
        return;
    }
    if (in_lockstep()) return; /* time stands still while narpa renders */
    if (seconds_since(app.clock_arrived_ns) > kHeartbeatSilence_s) {
        event(EVENT_ERROR, "no heartbeat of narpa for %g s", kHeartbeatSilence_s);
        app.is_over = app.has_failed = true;
        return;
    }
    if (app.has_started && app.machine.mode != MODE_DOCKED) {
        const struct status silent = {.silence_s = seconds_since(app.report_arrived_ns)};
        machine_step(&app.machine, &silent);
    }
    if (seconds_since(app.frame_seen_ns) > kNoFrames_s && seconds_since(app.frame_missed_ns) > kNoFrames_s) {
        event(EVENT_WARNING, "no frame for %.0f s", seconds_since(app.frame_seen_ns));
        app.frame_missed_ns = monotonic_ns();
    }
}

static void print_summary(void) {
    struct rusage used;
    getrusage(RUSAGE_SELF, &used);
    const double cpu_s = (double)(used.ru_utime.tv_sec + used.ru_stime.tv_sec) +
                         1e-6 * (double)(used.ru_utime.tv_usec + used.ru_stime.tv_usec);
    event(EVENT_INFO,
          "ends in mode %s: %" PRIu64 " cycles, %" PRIu64 " with lamps, %" PRIu64 " without a frame; %" PRIu64
          " commands late; %" PRIu64 " datagrams lost; CAN: %" PRIu64 " frames sent, %" PRIu64 " not, %" PRIu64
          " bad, %" PRIu64 " incomplete sets; longest cycle %.1f ms, CPU %.2f s",
          mode_table[app.machine.mode].name, app.cycles, app.cycles_with_lamps, app.cycles_without_frame,
          app.commands_late, frame_input_datagrams_lost(), app.bus.sent, app.bus.unsent, app.decoder.bad,
          app.decoder.incomplete, app.longest_cycle_s * 1e3, cpu_s);
}

int app_run(const struct app_options *options) {
    app.decoder.ledger_camera = mission.camera.index;
    int status = frame_input_open(options->video, &mission.camera);
    if (status == 0) status = can_bus_open(&app.bus, options->can, kBusPatience_s, options->stop);
    if (status != 0) return status;
    const struct status open = {.has_bus = true}, reports = {.has_bus = true, .has_reports = true};
    machine_step(&app.machine, &open);
    printf("ready\n"); /* to `narpa rehearse` */
    fflush(stdout);

    const int64_t t_begin_ns = monotonic_ns();
    app.frame_seen_ns = t_begin_ns;
    while (!app.is_over && !*options->stop) {
        struct pollfd fds[2] = {{.fd = app.bus.fd, .events = POLLIN}, {.fd = frame_input_fd(), .events = POLLIN}};
        poll(fds, 2, POLL_MS);
        receive_messages();
        receive_frame();
        if (app.is_over) break;
        if (app.machine.mode == MODE_WAIT && app.has_clock && app.has_dynamics && app.has_report) {
            machine_step(&app.machine, &reports);
            app.frame_seen_ns = monotonic_ns();
        }
        if (is_time_for_cycle()) cycle();
        if (app.run_state == HEARTBEAT_RUNNING && seconds_since(app.t_heartbeat_ns) > 1) send_heartbeat();
        check_silence(t_begin_ns);
    }
    print_summary();
    can_bus_close(&app.bus);
    return app.has_failed ? EXIT_FAILED : 0;
}
