/* vec.h - vectors, rotations. Quaternions: (w, x, y, z), Hamilton's convention. q_AB and R_AB take B's axes to A's. */
#ifndef VEC_H
#define VEC_H

struct vec3 {
    double x, y, z;
};
struct quat {
    double w, x, y, z;
};
struct mat3 {
    double m[3][3];
};

struct vec3 vec_of(const double v[3]);
struct vec3 vec_add(struct vec3 a, struct vec3 b);
struct vec3 vec_sub(struct vec3 a, struct vec3 b);
struct vec3 vec_scaled(double s, struct vec3 v);
struct vec3 vec_cross(struct vec3 a, struct vec3 b);
double vec_dot(struct vec3 a, struct vec3 b);
double vec_norm(struct vec3 v);

struct vec3 mat_vec(const struct mat3 *a, struct vec3 v);
struct vec3 mat_transposed_vec(const struct mat3 *a, struct vec3 v);
struct mat3 mat_product(const struct mat3 *a, const struct mat3 *b);
struct mat3 mat_transposed(const struct mat3 *a);

struct quat quat_product(struct quat a, struct quat b); /* the rotation by b, then by a */
struct quat quat_conjugate(struct quat q);              /* the inverse rotation */
struct quat quat_normalised(struct quat q);
struct quat quat_from_vector(struct vec3 rotation_rad); /* by the angle |rotation| about its direction */
struct vec3 quat_to_vector(struct quat q);              /* the shortest rotation vector, rad */
struct mat3 quat_to_mat(struct quat q);

#endif
