#include "filter.h"

#include <math.h>
#include <string.h>

#include "marks.h"

static const double kPixelSigma =
    0.35; /* of a lamp in the image; 0.2, and more as errors of consecutive images correlate */
static const double kPi = 3.14159265358979323846;

struct jacobian {
    double by_error[2][ERRORS]; /* of a pixel's x and y */
};

/* (dr/dt, dv/dt) = A (r, v): Hill's equations, x along the orbit, z up. */
static void hill_matrix(double A[6][6]) {
    const double n = mission.orbit_rate_rad_s;
    memset(A, 0, 36 * sizeof(double));
    A[0][3] = A[1][4] = A[2][5] = 1;
    A[3][5] = -2 * n, A[4][1] = -n * n, A[5][2] = 3 * n * n, A[5][3] = 2 * n;
}

struct vec3 filter_free_acceleration(const struct filter *f) {
    double A[6][6];
    hill_matrix(A);
    const double state[6] = {f->r.x, f->r.y, f->r.z, f->v.x, f->v.y, f->v.z};
    double a[3] = {0};
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 6; ++j) a[i] += A[3 + i][j] * state[j];
    return vec_of(a);
}

void filter_start(struct filter *f, const struct mat3 *R_LC) {
    memset(f, 0, sizeof *f);
    f->r = vec_add(mission.start_m, mat_vec(R_LC, mission.centre_of_mass_m));
    f->q_LT = (struct quat){1, 0, 0, 0};
    const struct vec3 r = mission.start_sigma_m, v = mission.start_velocity_sigma_m_s;
    const double sigma[ERRORS] = {r.x,
                                  r.y,
                                  r.z,
                                  v.x,
                                  v.y,
                                  v.z,
                                  mission.start_attitude_sigma_rad[0],
                                  mission.start_attitude_sigma_rad[1],
                                  mission.start_attitude_sigma_rad[2]};
    for (int i = 0; i < ERRORS; ++i) f->P[i][i] = sigma[i] * sigma[i];
}

void filter_predict(struct filter *f, const struct thrust *thrust) {
    const double T = mission.period_s;
    double A[6][6], F[ERRORS][ERRORS] = {{0}}, FP[ERRORS][ERRORS],
                    state[6] = {f->r.x, f->r.y, f->r.z, f->v.x, f->v.y, f->v.z};
    hill_matrix(A);
    for (int i = 0; i < ERRORS; ++i) F[i][i] = 1;
    for (int i = 0; i < 6; ++i)
        for (int j = 0; j < 6; ++j) {
            F[i][j] += A[i][j] * T;
            for (int k = 0; k < 6; ++k) F[i][j] += A[i][k] * A[k][j] * T * T / 2;
        }
    double next[6] = {0};
    for (int i = 0; i < 6; ++i)
        for (int j = 0; j < 6; ++j) next[i] += F[i][j] * state[j];
    f->r = vec_add((struct vec3){next[0], next[1], next[2]}, thrust->shift);
    f->v = vec_add((struct vec3){next[3], next[4], next[5]}, thrust->dv);

    for (int i = 0; i < ERRORS; ++i)
        for (int j = 0; j < ERRORS; ++j) {
            FP[i][j] = 0;
            for (int k = 0; k < ERRORS; ++k) FP[i][j] += F[i][k] * f->P[k][j];
        }
    for (int i = 0; i < ERRORS; ++i)
        for (int j = 0; j < ERRORS; ++j) {
            f->P[i][j] = 0;
            for (int k = 0; k < ERRORS; ++k) f->P[i][j] += FP[i][k] * F[j][k];
        }
    const double total = vec_norm(thrust->dv), along[3] = {thrust->dv.x, thrust->dv.y, thrust->dv.z};
    for (int i = 0; i < 3; ++i) {
        const double sigma = 0.02 * fabs(along[i]) + 0.01 * total + 1e-5; /* gain, misalignment; m/s */
        const double q = sigma * sigma;
        f->P[i][i] += q * T * T / 4;
        f->P[i][3 + i] += q * T / 2, f->P[3 + i][i] += q * T / 2;
        f->P[3 + i][3 + i] += q;
        f->P[6 + i][6 + i] += 1e-12;
    }
}

/* Where the lamps are in the image, and how that changes with the errors of the state. */
static void project(const struct filter *f, const struct mat3 *R_LC, struct view views[], struct jacobian jacobians[]) {
    const struct camera_table *camera = &mission.camera;
    const struct mat3 R_CK = quat_to_mat(camera->q_CK), R_LK = mat_product(R_LC, &R_CK), R_LT = quat_to_mat(f->q_LT);
    const struct vec3 camera_L = vec_add(f->r, mat_vec(R_LC, vec_sub(camera->position_m, mission.centre_of_mass_m)));
    for (int l = 0; l < mission.lamps; ++l) {
        const struct vec3 lamp = mat_vec(&R_LT, mission.lamp[l].position_m); /* in L, from the target */
        const struct vec3 p = mat_transposed_vec(&R_LK, vec_sub(lamp, camera_L));
        struct view *view = &views[l];
        memset(view, 0, sizeof *view);
        memset(&jacobians[l], 0, sizeof jacobians[l]);
        view->is_visible = p.z > 0.05;
        if (!view->is_visible) continue;
        view->x = camera->cx + camera->fx * p.x / p.z, view->y = camera->cy + camera->fy * p.y / p.z;
        const double radius_px = camera->fx * mission.lamp[l].radius_m / p.z;
        view->area = kPi * radius_px * radius_px;
        const double by_p[2][3] = {{camera->fx / p.z, 0, -camera->fx * p.x / (p.z * p.z)},
                                   {0, camera->fy / p.z, -camera->fy * p.y / (p.z * p.z)}};
        for (int axis = 0; axis < 2; ++axis) {
            const struct vec3 by_lamp = mat_vec(&R_LK, vec_of(by_p[axis])); /* by the lamp's position in L */
            const struct vec3 by_turn = vec_cross(lamp, by_lamp);
            const double row[ERRORS] = {-by_lamp.x, -by_lamp.y, -by_lamp.z, 0, 0, 0, by_turn.x, by_turn.y, by_turn.z};
            memcpy(jacobians[l].by_error[axis], row, sizeof row);
        }
    }
}

/* Three standard deviations of the lamps' pixels, at most. */
static double search_radius_px(const struct filter *f, const struct jacobian jacobians[]) {
    double most = 0;
    for (int l = 0; l < mission.lamps; ++l) {
        double variance = 0;
        for (int axis = 0; axis < 2; ++axis)
            for (int i = 0; i < ERRORS; ++i)
                for (int j = 0; j < ERRORS; ++j)
                    variance += jacobians[l].by_error[axis][i] * f->P[i][j] * jacobians[l].by_error[axis][j];
        most = fmax(most, variance);
    }
    return 3 * sqrt(most) + 1;
}

/* Updates the errors and their covariance by one coordinate of a lamp's pixel. */
static void update_by(double error[ERRORS], double P[ERRORS][ERRORS], const double h[ERRORS], double residual) {
    double Ph[ERRORS], innovation = residual, variance = kPixelSigma * kPixelSigma;
    for (int i = 0; i < ERRORS; ++i) {
        Ph[i] = 0;
        for (int j = 0; j < ERRORS; ++j) Ph[i] += P[i][j] * h[j];
    }
    for (int i = 0; i < ERRORS; ++i) innovation -= h[i] * error[i], variance += h[i] * Ph[i];
    for (int i = 0; i < ERRORS; ++i) {
        error[i] += Ph[i] / variance * innovation;
        for (int j = 0; j < ERRORS; ++j) P[i][j] -= Ph[i] * Ph[j] / variance;
    }
}

int filter_update(struct filter *f, const uint8_t *image, const struct mat3 *R_LC) {
    enum { PASSES = 3, SCALES = 11 };
    static struct spot spots[SPOTS_MAX];
    struct view views[LAMPS_MAX];
    struct jacobian jacobians[LAMPS_MAX];
    const int lamps = mission.lamps;
    const struct filter before = *f;
    project(f, R_LC, views, jacobians);
    const int n = find_spots(image, mission.camera.width, mission.camera.height, views, lamps, spots);

    /* Linearised again at each pass, with a smaller window. Until lamps have been found, the distance may be wrong too.
     */
    const double windows_px[PASSES] = {2.5, 2.0, 1.2}, one = 1;
    double wide[SCALES], error[ERRORS] = {0};
    for (int i = 0; i < SCALES; ++i) wide[i] = 0.85 + 0.03 * i;
    int used = 0;
    for (int pass = 0; pass < PASSES; ++pass) {
        const bool search = pass == 0, any_scale = search && !before.is_locked;
        int found[LAMPS_MAX];
        used = assign_spots(views, lamps, spots, n, search ? search_radius_px(f, jacobians) : 0, windows_px[pass],
                            any_scale ? wide : &one, any_scale ? SCALES : 1, found);
        if (used < (before.is_locked ? 4 : 8)) {
            *f = before;
            return 0;
        }
        double total[ERRORS] = {0};
        memcpy(f->P, before.P, sizeof f->P);
        for (int l = 0; l < lamps; ++l) {
            if (found[l] == NO_SPOT) continue;
            const double off[2] = {spots[found[l]].x - views[l].x, spots[found[l]].y - views[l].y};
            for (int axis = 0; axis < 2; ++axis) {
                const double *h = jacobians[l].by_error[axis];
                double residual = off[axis]; /* against the state before all passes */
                for (int i = 0; i < ERRORS; ++i) residual += h[i] * error[i];
                update_by(total, f->P, h, residual);
            }
        }
        memcpy(error, total, sizeof error);
        f->r = vec_add(before.r, vec_of(error)), f->v = vec_add(before.v, vec_of(error + 3));
        f->q_LT = quat_normalised(quat_product(quat_from_vector(vec_of(error + 6)), before.q_LT));
        project(f, R_LC, views, jacobians);
    }
    f->is_locked = true;
    return used;
}

struct estimate filter_estimate(const struct filter *f, struct quat q_LC) {
    const struct mat3 R_LC = quat_to_mat(q_LC);
    const double tracker = mission.tracker_sigma_rad, position_by_tracker = tracker * tracker * vec_dot(f->r, f->r);
    double sigma[6];
    for (int axis = 0; axis < 3; ++axis) {
        const double along[3] = {R_LC.m[0][axis], R_LC.m[1][axis], R_LC.m[2][axis]}; /* C's axis in L */
        double position = position_by_tracker, rotation = tracker * tracker;
        for (int i = 0; i < 3; ++i)
            for (int j = 0; j < 3; ++j) {
                position += along[i] * f->P[i][j] * along[j];
                rotation += along[i] * f->P[6 + i][6 + j] * along[j];
            }
        sigma[axis] = sqrt(position), sigma[3 + axis] = sqrt(rotation);
    }
    return (struct estimate){.position_m = vec_sub(mission.centre_of_mass_m, mat_transposed_vec(&R_LC, f->r)),
                             .sigma_m = vec_of(sigma),
                             .sigma_rad = vec_of(sigma + 3),
                             .q_CT = quat_product(quat_conjugate(q_LC), f->q_LT)};
}
