#include "guidance.h"

#include <math.h>
#include <string.h>

static const struct quat kDocked_TC = {0, 0, 0, 1}; /* half a turn about z */
static const double kArrived_m = 1e-3;

/* The reference takes a fifth of what the thrusters can; the rest is for control. */
static double acceleration_m_s2(void) { return 0.2 * mission.force_n / mission.mass_kg; }

void guidance_start(struct guidance *g) {
    memset(g, 0, sizeof *g);
    g->position_m = mission.start_m;
}

struct vec3 guidance_port(const struct filter *f, const struct mat3 *R_LC) {
    const struct mat3 R_LT = quat_to_mat(f->q_LT);
    return mat_transposed_vec(&R_LT, vec_sub(f->r, mat_vec(R_LC, mission.centre_of_mass_m)));
}

void guidance_retreat(struct guidance *g, const struct filter *f, const struct mat3 *R_LC) {
    const struct mat3 R_LT = quat_to_mat(f->q_LT);
    g->position_m = guidance_port(f, R_LC);
    g->velocity_m_s = mat_transposed_vec(&R_LT, f->v);
}

bool guidance_is_on_contact_leg(const struct guidance *g) { return mission.leg[g->leg].contact; }

/* Moves the reference along its leg for a period. The leg with contact goes on until there is one. */
static enum phase follow_leg(struct guidance *g, struct vec3 port_m) {
    const struct leg *leg = &mission.leg[g->leg];
    const double T = mission.period_s, most = acceleration_m_s2();
    const struct vec3 end = leg->contact ? vec_sub(leg->to_m, (struct vec3){1, 0, 0}) : leg->to_m;
    const struct vec3 way = vec_sub(end, g->position_m), before = g->velocity_m_s;
    const double left = vec_norm(way);
    const bool arrived = left <= kArrived_m;
    if (arrived) {
        g->position_m = end, g->velocity_m_s = (struct vec3){0, 0, 0};
        g->held_s += T;
    } else {
        const double speed =
            fmin(fmin(leg->speed_m_s, vec_norm(before) + most * T), fmin(sqrt(2 * most * left), left / T));
        g->velocity_m_s = vec_scaled(speed / left, way);
        g->position_m = vec_add(g->position_m, vec_scaled(T / 2, vec_add(before, g->velocity_m_s)));
    }
    if (g->held_s > leg->hold_s && vec_norm(vec_sub(port_m, end)) < leg->within_m && g->leg + 1 < mission.legs)
        ++g->leg, g->held_s = 0;
    return arrived ? PHASE_HOLDING : PHASE_MOVING;
}

/* Changes the reference's velocity to `wanted` as fast as the acceleration permits. */
static void change_velocity(struct guidance *g, struct vec3 wanted) {
    const double T = mission.period_s, most = acceleration_m_s2() * T;
    const struct vec3 before = g->velocity_m_s, change = vec_sub(wanted, before);
    const double size = vec_norm(change);
    g->velocity_m_s = size > most ? vec_add(before, vec_scaled(most / size, change)) : wanted;
    g->position_m = vec_add(g->position_m, vec_scaled(T / 2, vec_add(before, g->velocity_m_s)));
}

/* The impulse along one axis that pulses can give. What is too small is kept for later. */
static double fire(double wanted, double strength, double longest_s, double *kept) {
    wanted += *kept;
    const bool small = fabs(wanted) < strength * mission.min_on_s;
    *kept = small ? wanted : 0;
    return small ? 0 : fmin(fmax(wanted, -strength * longest_s), strength * longest_s);
}

static struct vec3 fire_all(struct vec3 wanted, double strength, double longest_s, struct vec3 *kept) {
    return (struct vec3){fire(wanted.x, strength, longest_s, &kept->x), fire(wanted.y, strength, longest_s, &kept->y),
                         fire(wanted.z, strength, longest_s, &kept->z)};
}

/* The acceleration of a proportional-derivative controller. */
static struct vec3 pd(struct vec3 error, struct vec3 error_rate, double bandwidth_rad_s) {
    return vec_add(vec_scaled(bandwidth_rad_s * bandwidth_rad_s, error),
                   vec_scaled(2 * mission.damping * bandwidth_rad_s, error_rate));
}

struct command guidance_step(struct guidance *g, const struct mode_row *mode, const struct filter *f, struct quat q_LC,
                             struct vec3 rate_rad_s, double lead_s) {
    const double T = mission.period_s;
    const struct mat3 R_LC = quat_to_mat(q_LC), R_LT = quat_to_mat(f->q_LT);
    struct command command = {.phase = mode->phase};
    const struct vec3 position = g->position_m, velocity = g->velocity_m_s; /* of the reference now */
    switch (mode->control) {
        case CONTROL_OFF: return command;
        case CONTROL_HOLD: change_velocity(g, (struct vec3){0, 0, 0}); break;
        case CONTROL_RETREAT: change_velocity(g, (struct vec3){mission.retreat_m_s, 0, 0}); break;
        case CONTROL_LEGS: {
            const enum phase phase = follow_leg(g, guidance_port(f, &R_LC));
            if (mode->phase == PHASE_MOVING) command.phase = phase;
            break;
        }
    }
    const struct vec3 acceleration = vec_scaled(1 / T, vec_sub(g->velocity_m_s, velocity));

    /* The reference of the centre of mass, in L. */
    const struct mat3 R_docked = quat_to_mat(kDocked_TC);
    const struct vec3 r = mat_vec(&R_LT, vec_add(position, mat_vec(&R_docked, mission.centre_of_mass_m)));
    const struct vec3 v = mat_vec(&R_LT, velocity);
    const struct vec3 a = vec_add(vec_sub(mat_vec(&R_LT, acceleration), filter_free_acceleration(f)),
                                  pd(vec_sub(r, f->r), vec_sub(v, f->v), mission.bandwidth_rad_s));
    const struct quat turn = quat_product(quat_conjugate(q_LC), quat_product(f->q_LT, kDocked_TC));
    const struct vec3 turn_rate =
        vec_sub(mat_transposed_vec(&R_LC, (struct vec3){0, mission.orbit_rate_rad_s, 0}), rate_rad_s);
    const struct vec3 alpha = pd(quat_to_vector(turn), turn_rate, mission.attitude_bandwidth_rad_s);

    const struct vec3 inertia = mission.inertia_kg_m2;
    command.impulse_n_s = fire_all(vec_scaled(mission.mass_kg * T, mat_transposed_vec(&R_LC, a)), mission.force_n,
                                   T - lead_s, &g->impulse_kept);
    command.angular_n_m_s =
        fire_all((struct vec3){inertia.x * T * alpha.x, inertia.y * T * alpha.y, inertia.z * T * alpha.z},
                 mission.torque_n_m, T - lead_s, &g->angular_kept);

    const struct vec3 dv = vec_scaled(1 / mission.mass_kg, command.impulse_n_s), impulse = command.impulse_n_s;
    const struct vec3 shift = {dv.x * (T - lead_s - fabs(impulse.x) / mission.force_n / 2),
                               dv.y * (T - lead_s - fabs(impulse.y) / mission.force_n / 2),
                               dv.z * (T - lead_s - fabs(impulse.z) / mission.force_n / 2)};
    command.thrust = (struct thrust){mat_vec(&R_LC, dv), mat_vec(&R_LC, shift)};
    return command;
}
