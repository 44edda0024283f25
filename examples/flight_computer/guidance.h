/* guidance.h - a reference that moves along the legs, controllers that follow it, and pulses that thrusters can fire.
 */
#ifndef GUIDANCE_H
#define GUIDANCE_H

#include "filter.h"
#include "modes.h"

struct guidance {
    int leg;
    double held_s;
    struct vec3 position_m, velocity_m_s;   /* the reference: of the chaser's port, in T */
    struct vec3 impulse_kept, angular_kept; /* too small for a pulse so far */
};

struct command {
    struct vec3 impulse_n_s, angular_n_m_s; /* in C */
    enum phase phase;
    struct thrust thrust; /* what it will do to the chaser in this period */
};

void guidance_start(struct guidance *g);
/* Begins a retreat from where the chaser is. */
void guidance_retreat(struct guidance *g, const struct filter *f, const struct mat3 *R_LC);
bool guidance_is_on_contact_leg(const struct guidance *g);
struct vec3 guidance_port(const struct filter *f, const struct mat3 *R_LC); /* the chaser's port, in T */

/* The command of a period, which acts from `lead_s` after its begin. `rate_rad_s`: of the chaser, in C. */
struct command guidance_step(struct guidance *g, const struct mode_row *mode, const struct filter *f, struct quat q_LC,
                             struct vec3 rate_rad_s, double lead_s);

#endif
