/* The scenario that is flown: written by mission_table.py from a rehearsal's folder. */
#include "mission.h"

const struct mission mission = {
    .scenario = "dispersions",
    .camera = {.name = "nav", .index = 0, .width = 320, .height = 240,
               .rate_hz = 1.0, .fx = 386.27416997969516, .fy = 386.27416997969516, .cx = 159.5, .cy = 119.5,
               .position_m = {-0.45, 0.0, 0.0}, .q_CK = {0.5, -0.5, 0.5, -0.5}},
    .lamps = 14,
    .lamp = {
        {{-0.412, 0.245, 0.0}, 0.012}, /* hatch_1 */
        {{-0.404, 0.319612, 0.319612}, 0.012}, /* hatch_2 */
        {{-0.412, 0.0, 0.245}, 0.012}, /* hatch_3 */
        {{-0.404, -0.319612, 0.319612}, 0.012}, /* hatch_4 */
        {{-0.412, -0.245, 0.0}, 0.012}, /* hatch_5 */
        {{-0.404, -0.319612, -0.319612}, 0.012}, /* hatch_6 */
        {{-0.412, 0.0, -0.245}, 0.012}, /* hatch_7 */
        {{-0.404, 0.319612, -0.319612}, 0.012}, /* hatch_8 */
        {{-0.1, 0.906099, 0.658319}, 0.035}, /* post_1 */
        {{-0.4, -0.270953, 1.086731}, 0.035}, /* post_2 */
        {{-0.1, -0.969948, 0.56}, 0.035}, /* post_3 */
        {{-0.4, -0.906099, -0.658319}, 0.035}, /* post_4 */
        {{-0.1, -0.155874, -1.1091}, 0.035}, /* post_5 */
        {{-0.25, 0.882572, -0.689541}, 0.035}, /* post_6 */
    },
    .legs = 2,
    .leg = {
        {.to_m = {2.0, 0.0, 0.0}, .speed_m_s = 0.25, .hold_s = 5.0, .within_m = 0.05, .contact = false}, /* hold at 2 m */
        {.to_m = {0.0, 0.0, 0.0}, .speed_m_s = 0.075, .hold_s = 0.0, .within_m = 1000000000.0, .contact = true}, /* contact */
    },
    .period_s = 1.0,
    .orbit_rate_rad_s = 0.0011313666536110223,
    .start_m = {10.0, 0.0, 0.0},
    .start_sigma_m = {0.5, 0.25, 0.25},
    .start_velocity_sigma_m_s = {0.03, 0.02, 0.02},
    .start_attitude_sigma_rad = {0.026179938779914945, 0.026179938779914945, 0.026179938779914945},
    .mass_kg = 9500.0,
    .inertia_kg_m2 = {22000.0, 31000.0, 31000.0},
    .centre_of_mass_m = {-3.2, 0.0, 0.0},
    .force_n = 400.0, .torque_n_m = 400.0, .min_on_s = 0.02,
    .tracker_sigma_rad = 8.726646259971648e-05,
    .bandwidth_rad_s = 0.15,
    .attitude_bandwidth_rad_s = 0.25,
    .damping = 0.9,
    .abort_sigma_m = 2.0,
    .abort_lost_s = 20.0,
    .abort_off_m = 5.0,
    .retreat_m_s = 0.3,
};
