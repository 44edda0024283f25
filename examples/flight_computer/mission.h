/* mission.h - what the flight computer knows before the flight. mission.c has the values; mission_table.py writes it
 * from a rehearsal. (cFS: a table of CFE_TBL; F': parameters.)
 *
 * Axes: T, C, K: target (origin: its port), chaser (origin: its port), camera (x right, y down, z forward). L rotates
 * with the target's orbit: x along its velocity, z up; its origin is the target's. */
#ifndef MISSION_H
#define MISSION_H

#include <stdbool.h>
#include <stdint.h>

#include "vec.h"

enum { LAMPS_MAX = 32, LEGS_MAX = 8, IMAGE_BYTES_MAX = 2048 * 1536 };

struct camera_table {
    const char *name;
    uint8_t index; /* in the scene: its ledger is at 0x600 + 16 * index */
    int width, height;
    double rate_hz;
    double fx, fy, cx, cy;  /* px; the centre of the top left pixel is (0, 0) */
    struct vec3 position_m; /* in C */
    struct quat q_CK;
};
struct lamp {
    struct vec3 position_m; /* in T */
    double radius_m;
};
struct leg {
    struct vec3 to_m; /* of the chaser's port, in T */
    double speed_m_s, hold_s, within_m;
    bool contact;
};
struct mission {
    const char *scenario;
    struct camera_table camera;
    int lamps, legs;
    struct lamp lamp[LAMPS_MAX];
    struct leg leg[LEGS_MAX];

    double period_s; /* of control */
    double orbit_rate_rad_s;
    struct vec3 start_m; /* of the chaser's port, in T; and standard deviations */
    struct vec3 start_sigma_m, start_velocity_sigma_m_s;
    double start_attitude_sigma_rad[3];

    double mass_kg;
    struct vec3 inertia_kg_m2, centre_of_mass_m; /* in C */
    double force_n, torque_n_m, min_on_s;        /* of the thrusters along each axis */
    double tracker_sigma_rad;                    /* of the star tracker, each axis */
    double bandwidth_rad_s, attitude_bandwidth_rad_s, damping;
    double abort_sigma_m, abort_lost_s, abort_off_m, retreat_m_s;
};

extern const struct mission mission;

#endif
