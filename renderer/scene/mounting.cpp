#include "renderer/scene/mounting.h"

#include <fmt/format.h>

#include <algorithm>

namespace narpa {

namespace {

constexpr TableKey kMountingRows[]{kNameRow, kMountRow, kPositionRow, kAttitudeRow, kLookAtRow, kUpRow};

constexpr std::size_t kLongestName = 64;

bool allowed_in_name(char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' || c == '-' ||
           c == '.';
}

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
    if (line == Vec3{} || !is_finite(line))
        return table.fail("look_at", "is the place that it looks from, expected another point");
    const Vec3 forward = normalized(scaled_to_one(line)), above = scaled_to_one(up), right = cross(forward, above);
    if (!(norm(right) > 1e-6 * norm(above)))
        return table.fail("look_at",
                          fmt::format("lies along up = [{}, {}, {}], expected another \"up\"", up.x, up.y, up.z));
    T.q = attitude_of(forward, normalized(right));
}

}  // namespace

constinit const TableKeys kMountingKeys{.rows = kMountingRows};

Quat camera_attitude(const Vec3& forward, const Vec3& right) {
    return quat_from_columns(right, cross(forward, right), forward);
}

Quat lidar_attitude(const Vec3& forward, const Vec3& right) {
    return quat_from_columns(right, forward, cross(right, forward));
}

Mounting read_mounting(TableReader& table, const std::vector<Body>& bodies, AttitudeOf attitude_of) {
    Mounting m;
    m.mount = read_mount(table, bodies);
    table.read("position_m", m.T_mount_sensor.t);
    table.read("attitude_wxyz", m.T_mount_sensor.q);
    read_look_at(table, m.T_mount_sensor, attitude_of);
    return m;
}

bool is_name(std::string_view name) {
    return !name.empty() && name.size() <= kLongestName && std::ranges::all_of(name, allowed_in_name);
}

std::string read_name(TableReader& table, TakenNames& taken) {
    std::string name = table.text("name").value_or("");
    if (table.has("name") && !is_name(name))
        table.fail("name", fmt::format("expected 1 to {} letters, digits, '_', '-' or '.'", kLongestName));
    if (!taken.insert(name).second && is_name(name))
        table.fail("name",
                   fmt::format("\"{}\" is the name of another {}, expected a name of its own", name, table.name()));
    return name;
}

}  // namespace narpa
