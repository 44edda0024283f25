#include "vec.h"

#include <math.h>

struct vec3 vec_of(const double v[3]) {
    return (struct vec3){v[0], v[1], v[2]};
}
struct vec3 vec_add(struct vec3 a, struct vec3 b) {
    return (struct vec3){a.x + b.x, a.y + b.y, a.z + b.z};
}
struct vec3 vec_sub(struct vec3 a, struct vec3 b) {
    return (struct vec3){a.x - b.x, a.y - b.y, a.z - b.z};
}
struct vec3 vec_scaled(double s, struct vec3 v) {
    return (struct vec3){s * v.x, s * v.y, s * v.z};
}
struct vec3 vec_cross(struct vec3 a, struct vec3 b) {
    return (struct vec3){a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
double vec_dot(struct vec3 a, struct vec3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
double vec_norm(struct vec3 v) { return sqrt(vec_dot(v, v)); }

struct vec3 mat_vec(const struct mat3 *a, struct vec3 v) {
    return (struct vec3){a->m[0][0] * v.x + a->m[0][1] * v.y + a->m[0][2] * v.z,
                         a->m[1][0] * v.x + a->m[1][1] * v.y + a->m[1][2] * v.z,
                         a->m[2][0] * v.x + a->m[2][1] * v.y + a->m[2][2] * v.z};
}
struct mat3 mat_transposed(const struct mat3 *a) {
    struct mat3 t;
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j) t.m[i][j] = a->m[j][i];
    return t;
}
struct vec3 mat_transposed_vec(const struct mat3 *a, struct vec3 v) {
    const struct mat3 t = mat_transposed(a);
    return mat_vec(&t, v);
}
struct mat3 mat_product(const struct mat3 *a, const struct mat3 *b) {
    struct mat3 c;
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j)
            c.m[i][j] = a->m[i][0] * b->m[0][j] + a->m[i][1] * b->m[1][j] + a->m[i][2] * b->m[2][j];
    return c;
}

struct quat quat_product(struct quat a, struct quat b) {
    return (struct quat){a.w * b.w - a.x * b.x - a.y * b.y - a.z * b.z, a.w * b.x + a.x * b.w + a.y * b.z - a.z * b.y,
                         a.w * b.y - a.x * b.z + a.y * b.w + a.z * b.x, a.w * b.z + a.x * b.y - a.y * b.x + a.z * b.w};
}
struct quat quat_conjugate(struct quat q) {
    return (struct quat){q.w, -q.x, -q.y, -q.z};
}
struct quat quat_normalised(struct quat q) {
    const double n = sqrt(q.w * q.w + q.x * q.x + q.y * q.y + q.z * q.z);
    return (struct quat){q.w / n, q.x / n, q.y / n, q.z / n};
}
struct quat quat_from_vector(struct vec3 rotation_rad) {
    const double angle = vec_norm(rotation_rad);
    const struct vec3 v = vec_scaled(angle > 1e-9 ? sin(angle / 2) / angle : 0.5, rotation_rad);
    return (struct quat){cos(angle / 2), v.x, v.y, v.z};
}
struct vec3 quat_to_vector(struct quat q) {
    const double sign = q.w < 0 ? -1 : 1;
    const struct vec3 v = {sign * q.x, sign * q.y, sign * q.z};
    const double length = vec_norm(v);
    return vec_scaled(length > 1e-9 ? 2 * atan2(length, sign * q.w) / length : 2, v);
}
struct mat3 quat_to_mat(struct quat q) {
    const double w = q.w, x = q.x, y = q.y, z = q.z;
    return (struct mat3){{{1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)},
                          {2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)},
                          {2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)}}};
}
