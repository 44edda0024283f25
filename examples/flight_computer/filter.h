/* filter.h - an extended Kalman filter of the motion relative to the target. */
#ifndef FILTER_H
#define FILTER_H

#include <stdbool.h>
#include <stdint.h>

#include "mission.h"

enum { ERRORS = 9 }; /* of r, of v, and a rotation vector in L */

struct filter {
    struct vec3 r, v; /* the chaser's centre of mass, in L: m, m/s */
    struct quat q_LT;
    double P[ERRORS][ERRORS]; /* covariance of the errors */
    bool is_locked;           /* lamps have been found */
};

/* What the thrusters do within a period: changes of velocity and position in L. */
struct thrust {
    struct vec3 dv, shift;
};

/* All of these with R_LC: the chaser's attitude, from its star tracker. */
void filter_start(struct filter *f, const struct mat3 *R_LC);
void filter_predict(struct filter *f, const struct thrust *thrust);                 /* over a control period */
int filter_update(struct filter *f, const uint8_t *image, const struct mat3 *R_LC); /* returns how many lamps it used */
struct vec3 filter_free_acceleration(const struct filter *f);                       /* Hill's equations; in L */

/* The target in C, with standard deviations along C's axes: those of the filter and that of the star tracker. */
struct estimate {
    struct vec3 position_m, sigma_m, sigma_rad;
    struct quat q_CT;
};
struct estimate filter_estimate(const struct filter *f, struct quat q_LC);

#endif
