#include "rehearsal/dynamics/flight_log.h"

#include <fmt/format.h>

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "base/time.h"
#include "rehearsal/dynamics/thruster_model.h"

namespace narpa::rehearsal {
namespace {

constexpr std::string_view kHeader =
    "t_s,x_m,y_m,z_m,vx_m_s,vy_m_s,vz_m_s,rotation_x_deg,rotation_y_deg,rotation_z_deg,rate_x_deg_s,rate_y_deg_s,"
    "rate_z_deg_s,dynamics_phase,guidance_phase,leg,abort,impulse_x_n_s,impulse_y_n_s,impulse_z_n_s,"
    "angular_impulse_x_n_m_s,angular_impulse_y_n_m_s,angular_impulse_z_n_m_s\n";

std::string fields(const Vec3& v, double scale = 1) {
    return fmt::format(",{:.9g},{:.9g},{:.9g}", scale * v.x, scale * v.y, scale * v.z);
}

nlohmann::json numbers(const Vec3& v, double scale = 1) {
    return {scale * v.x, scale * v.y, scale * v.z};
}

nlohmann::json to_json(const PortState& p) {
    return {{"position_m", numbers(p.position_m())},
            {"velocity_m_s", numbers(p.velocity_m_s)},
            {"attitude_deg", numbers(p.misalignment_rad(), 1 / kDegree)},
            {"rate_deg_s", numbers(p.rate_rad_s, 1 / kDegree)}};
}

}  // namespace

Result<TruthLog> TruthLog::create(const std::string& folder) {
    std::error_code failure;
    std::filesystem::create_directories(folder, failure);
    const std::string path = folder + "/truth.csv";
    std::ofstream file(path);
    if (!file) return Error{fmt::format("cannot be written: {}", std::strerror(errno)), path};
    file << kHeader;
    return TruthLog(path, std::move(file));
}

void TruthLog::append(const Simulation& s) {
    const PortState p = s.port();
    const ActuatorCommand& c = s.command();
    const Loads& fired = s.fired();
    file_ << fmt::format("{:.9f}", to_seconds(s.t_ns())) << fields(p.position_m()) << fields(p.velocity_m_s)
          << fields(p.misalignment_rad(), 1 / kDegree) << fields(p.rate_rad_s, 1 / kDegree)
          << fmt::format(",{},{},{},{}", kDynamicsPhases[static_cast<std::size_t>(s.phase())],
                         kGuidancePhases[static_cast<std::size_t>(c.phase)], c.leg,
                         kAbortReasons[static_cast<std::size_t>(c.abort)])
          << fields(fired.force_n - fired_.force_n) << fields(fired.torque_n_m - fired_.torque_n_m) << '\n';
    fired_ = fired;
}

Status TruthLog::close() {
    file_.close();
    if (!file_) return Error{"could not be written in whole", path_, 0, 0, ErrorKind::failed};
    return Ok{};
}

nlohmann::json summary(const Simulation& s, const Scenario& scenario, std::uint64_t seed) {
    const StartDraws& draws = s.start_draws();
    nlohmann::json directions = nlohmann::json::array();
    for (const Vec3& d : s.thrusters().directions()) directions.push_back(numbers(d));
    nlohmann::json contact;
    if (s.contact()) {
        contact = to_json(s.contact()->port);
        contact["t_s"] = to_seconds(s.contact()->t_ns);
        contact["captured"] = s.contact()->captured;
    }
    return {{"scenario", scenario.name},
            {"seed", seed},
            {"draws",
             {{"start_position", numbers(draws.position)},
              {"start_velocity", numbers(draws.velocity)},
              {"start_attitude", numbers(draws.attitude)},
              {"start_rate", numbers(draws.rate)},
              {"thruster_directions", std::move(directions)}}},
            {"contact", std::move(contact)},
            {"ending", kEndings[static_cast<std::size_t>(s.ending())]},
            {"end_s", to_seconds(s.t_ns())},
            {"port_at_end", to_json(s.port())},
            {"impulse_n_s", numbers(s.fired().force_n)},
            {"angular_impulse_n_m_s", numbers(s.fired().torque_n_m)}};
}

}  // namespace narpa::rehearsal
