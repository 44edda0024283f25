#include "apps/pose_options.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>

#include "emulator/trajectory.h"

namespace narpa::cli {
namespace {

Result<Rigid3> parse_pose(const std::string& text) {
    std::array<double, 7> v{};
    const char* at = text.data();
    const char* end = at + text.size();
    for (std::size_t i = 0; i < v.size(); ++i) {
        const auto [next, error] = std::from_chars(at, end, v[i]);
        const bool last = i + 1 == v.size();
        if (error != std::errc{} || !std::isfinite(v[i]) || (last ? next != end : next == end || *next != ','))
            return Error{
                fmt::format("--pose \"{}\", expected BODY=x,y,z,qw,qx,qy,qz (metres, unit quaternion)", text)};
        at = next + 1;
    }
    Rigid3 T{{v[3], v[4], v[5], v[6]}, {v[0], v[1], v[2]}};
    if (!accept_attitude(T.q))
        return Error{fmt::format("--pose \"{}\": the quaternion's norm is {:.6g}, expected 1", text,
                                 norm(Quat{v[3], v[4], v[5], v[6]}))};
    return T;
}

}  // namespace

void PoseOptions::add_to(Parser app) {
    app.option("--trajectory", trajectory, "Trajectory or truth log (CSV) with the bodies' poses");
    app.option("--pose", poses, "BODY=x,y,z,qw,qx,qy,qz: a body's pose (metres; body to world), at any time")
        .type_name("POSE")
        .values(1, 1)
        .repeatable();
}

Status PoseOptions::place(Scene& scene) const {
    for (const std::string& text : poses) {
        auto pair = split_pair(text, "BODY=x,y,z,qw,qx,qy,qz");
        if (!pair) return pair.error();
        auto T = parse_pose(pair->second);
        if (!T) return T.error();
        const auto body = std::find_if(scene.bodies.begin(), scene.bodies.end(),
                                       [&](const Body& b) { return b.name == pair->first; });
        if (body == scene.bodies.end())
            return Error{fmt::format("--pose: no body named \"{}\" in the scene", pair->first), scene.file};
        body->initial = {*T, {}, {}};
    }
    return Ok{};
}

Status PoseOptions::load(World& world, std::int64_t t_from_ns, std::int64_t t_to_ns) const {
    if (trajectory.empty()) return Ok{};
    auto rows = read_trajectory(trajectory);
    if (!rows) return rows.error();
    return world.load(*rows, t_from_ns, t_to_ns);
}

}  // namespace narpa::cli
