/// tests/protocols/can_support.h - pose commands and frames for the tests of protocols/can.
#pragma once

#include <random>
#include <vector>

#include "protocols/can/messages.h"

namespace narpa {

inline PoseCommand random_command(std::mt19937_64& rng, double reach_m) {
    std::normal_distribution<double> normal;
    std::uniform_real_distribution<double> unit(-1, 1);
    const auto vec = [&](double size) { return Vec3{size * unit(rng), size * unit(rng), size * unit(rng)}; };
    PoseCommand c;
    c.counter = static_cast<std::uint8_t>(rng());
    c.t_valid_ns = static_cast<std::int64_t>(rng() % 100'000'000'000'000);
    c.motion.T_world_body = {normalized(Quat{normal(rng), normal(rng), normal(rng), normal(rng)}), vec(reach_m)};
    c.motion.velocity_m_s = vec(10'000);
    c.motion.rate_rad_s = vec(2.5);
    return c;
}

inline bool same(const PoseCommand& a, const PoseCommand& b) {
    return a.counter == b.counter && a.t_valid_ns == b.t_valid_ns &&
           a.motion.T_world_body == b.motion.T_world_body && a.motion.velocity_m_s == b.motion.velocity_m_s &&
           a.motion.rate_rad_s == b.motion.rate_rad_s;
}

/// What a fresh decoder reads from frames that make one whole set.
inline PoseStatus decode_all(std::span<const CanFrame> frames, std::uint32_t base_id, std::int64_t t_reference_ns,
                             PoseCommand& out) {
    PoseDecoder decoder(base_id);
    PoseStatus status = PoseStatus::not_mine;
    for (const CanFrame& f : frames) status = decoder.accept(f, t_reference_ns, out);
    return status;
}

}  // namespace narpa
