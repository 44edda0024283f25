#include <fmt/format.h>

#include "renderer/scene_file/scene_parts.h"

namespace narpa {

namespace {

int read_mount(TableReader& table, const std::vector<Body>& bodies) {
    const auto name = table.text("mount");
    if (!name) return -1;
    std::string all;
    for (std::size_t i = 0; i < bodies.size(); ++i) {
        if (bodies[i].name == *name) return static_cast<int>(i);
        all += (all.empty() ? "\"" : ", \"") + bodies[i].name + "\"";
    }
    table.fail("mount",
               fmt::format("there is no body \"{}\", expected one of {}", *name, all.empty() ? "none" : all));
    return -1;
}

void read_look_at(TableReader& table, Rigid3& T, AttitudeOf attitude_of) {
    const auto target = table.vec3("look_at");
    const Vec3 up = table.vec3("up").value_or(Vec3{0, 0, 1});
    if (!table.has("look_at")) {
        if (table.has("up")) table.fail("up", "belongs to look_at, which is not here");
        return;
    }
    if (table.has("attitude_wxyz")) table.fail("look_at", "there is an attitude_wxyz too, expected one of the two");
    if (!target) return;
    const Vec3 line = *target - T.t;
    if (!(norm(line) > 1e-9) || !is_finite(line))
        return table.fail("look_at", "is the place that it looks from, expected another point");
    const Vec3 forward = normalized(scaled_to_one(line)), above = scaled_to_one(up), right = cross(forward, above);
    if (!(norm(right) > 1e-6 * norm(above)))
        return table.fail("look_at",
                          fmt::format("lies along up = [{}, {}, {}], expected another \"up\"", up.x, up.y, up.z));
    T.q = attitude_of(forward, normalized(right));
}

}  // namespace

Quat camera_attitude(const Vec3& forward, const Vec3& right) {
    return quat_from_columns(right, cross(forward, right), forward);
}

Quat lidar_attitude(const Vec3& forward, const Vec3& right) {
    return quat_from_columns(right, forward, cross(right, forward));
}

Mounting read_mounting(TableReader& table, const std::vector<Body>& bodies, AttitudeOf attitude_of) {
    Mounting m;
    m.mount = read_mount(table, bodies);
    m.T_mount_sensor.t = table.vec3("position_m").value_or(Vec3{});
    m.T_mount_sensor.q = table.attitude("attitude_wxyz").value_or(Quat{});
    read_look_at(table, m.T_mount_sensor, attitude_of);
    return m;
}

}  // namespace narpa
