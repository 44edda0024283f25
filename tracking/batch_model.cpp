#include "tracking/batch_model.h"

#include "estimator/batch/camera_change.h"
#include "renderer/scene/own_mesh.h"

namespace narpa {
namespace {

Status scale_body(double factor, std::size_t index, Scene& scene) {
    Body& body = scene.bodies[index];
    Mesh* const mesh = own_mesh(scene, index);
    if (!mesh)
        return Error{"a model error of scale is for a target with a mesh, which body \"" + body.name + "\" is not",
                     scene.file};
    for (Vec3f& p : mesh->positions) p = vec_cast<float>(factor * vec_cast<double>(p));
    for (Mark& m : body.marks) {
        m.T_body_mark.t = factor * m.T_body_mark.t;
        m.radius_m *= factor, m.side_m *= factor;
    }
    return Ok{};
}

Status change_projection(const BatchValues& e, Camera& camera, const Scene& scene) {
    auto changed = changed_camera(*camera.model, e);
    if (!changed)
        return Error{"a model error of camera \"" + camera.name + "\": " + changed.error().what, scene.file};
    camera.model = *std::move(changed);
    return Ok{};
}

/// Light as much brighter as the target reflects more of it: exact whatever its materials are.
void brighten(double factor, Scene& scene) {
    if (scene.sun) scene.sun->irradiance_w_m2 *= factor;
    scene.ambient = static_cast<float>(factor) * scene.ambient;
    for (Light& l : scene.lights) l.emission = static_cast<float>(factor) * l.emission;
}

/// The model's direction, from which rotations by minus the errors about its own axes lead to the truth.
Status turn_light(double x_rad, double y_rad, Scene& scene) {
    if (x_rad == 0 && y_rad == 0) return Ok{};
    if (!scene.sun) return Error{"a model error of the light's direction is for a scene with a Sun", scene.file};
    const Vec3 truth = normalized(scene.sun->direction);
    Vec3 wrong = truth;
    constexpr int kSteps = 20;
    for (int i = 0; i < kSteps; ++i) {
        const auto axes = light_axes(wrong);
        wrong = exp_rotation(x_rad * axes[0] + y_rad * axes[1]) * truth;
    }
    scene.sun->direction = wrong;
    return Ok{};
}

/// A sensor without a mount is where the scene puts it: it is then the chaser itself.
template <class Sensor>
Status displace(const BatchValues& e, BatchUnknown rotation, BatchUnknown shift, const Sensor& sensor,
                Rigid3& T_mount_sensor, const Scene& scene) {
    if (vector_at(e, rotation) == Vec3{} && vector_at(e, shift) == Vec3{}) return Ok{};
    if (sensor.mount < 0)
        return Error{"a model error of the mount is for a sensor on a body, which \"" + sensor.name + "\" is not",
                     scene.file};
    T_mount_sensor.q = normalized(T_mount_sensor.q * exp_rotation(vector_at(e, rotation)));
    T_mount_sensor.t = T_mount_sensor.t + vector_at(e, shift);
    return Ok{};
}

}  // namespace

Status apply_model_errors(const BatchValues& e, std::size_t target, Scene& scene) {
    if (at(e, BatchUnknown::scale) != 0)
        if (Status good = scale_body(1 + at(e, BatchUnknown::scale), target, scene); !good) return good;
    brighten(1 + at(e, BatchUnknown::albedo), scene);
    if (Status good = turn_light(at(e, BatchUnknown::light_x), at(e, BatchUnknown::light_y), scene); !good)
        return good;
    for (Camera& c : scene.cameras) {
        if (Status good = displace(e, BatchUnknown::camera_rx, BatchUnknown::camera_x, c, c.T_mount_camera, scene);
            !good)
            return good;
        for (const BatchUnknown u : kCameraUnknowns)
            if (at(e, u) != 0) {
                if (Status good = change_projection(e, c, scene); !good) return good;
                break;
            }
    }
    for (Lidar& l : scene.lidars)
        if (Status good = displace(e, BatchUnknown::lidar_rx, BatchUnknown::lidar_x, l, l.T_mount_lidar, scene);
            !good)
            return good;
    return Ok{};
}

BatchValues expected_of(const BatchValues& error) {
    BatchValues expected;
    for (std::size_t i = 0; i < kBatchUnknowns; ++i) {
        const auto u = static_cast<BatchUnknown>(i);
        if (u == BatchUnknown::scale || u == BatchUnknown::focal || u == BatchUnknown::aspect ||
            u == BatchUnknown::albedo)
            expected[i] = 1 / (1 + error[i]) - 1;
        else if (u == BatchUnknown::clock || u == BatchUnknown::range_bias)
            expected[i] = error[i];  // of the data, not of the scene
        else
            expected[i] = 0 - error[i];
    }
    return expected;
}

}  // namespace narpa
