#include "rehearsal/navigation/navigation_log.h"

#include <fmt/format.h>

#include <filesystem>
#include <nlohmann/json.hpp>

#include "renderer/image/image_file.h"

namespace narpa::rehearsal {
namespace {

constexpr const char* kCycleHeader =
    "cycle,t_ns,t_s,phase,leg,abort,port_x_m,port_y_m,port_z_m,port_vx_m_s,port_vy_m_s,port_vz_m_s,ref_x_m,ref_y_m,"
    "ref_z_m,off_x_m,off_y_m,off_z_m,off_attitude_deg,sigma_position_m,sigma_x_m,sigma_y_m,sigma_z_m,sigma_rx_deg,"
    "sigma_ry_deg,sigma_rz_deg,impulse_x_n_s,impulse_y_n_s,impulse_z_n_s,angular_x_n_m_s,angular_y_n_m_s,"
    "angular_z_n_m_s,frames,sweeps\n";
constexpr const char* kMeasurementHeader = "t_ns,sensor,outcome,nis,points,ms,answer,why\n";

std::string csv_numbers(const Vec3& v, const char* form = "{:.6g}") {
    return fmt::format(fmt::runtime(fmt::format("{0},{0},{0}", form)), v.x, v.y, v.z);
}

/// A leg's name as part of a file name.
std::string file_name_part(std::string name) {
    for (char& c : name)
        if (!std::isalnum(static_cast<unsigned char>(c))) c = '_';
    return name;
}

Result<std::ofstream> begin(const std::string& path, const char* header) {
    std::ofstream file(path);
    file << header;
    if (!file) return Error{"cannot be written", path};
    return file;
}

}  // namespace

Result<std::unique_ptr<NavigationLog>> NavigationLog::create(const std::string& folder, const Scenario& scenario) {
    std::error_code error;
    std::filesystem::create_directories(folder, error);
    if (error) return Error{"cannot be made a folder: " + error.message(), folder};
    std::unique_ptr<NavigationLog> log(new NavigationLog);
    log->folder_ = folder;
    for (const Leg& leg : scenario.legs) log->legs_.push_back(leg.name);
    auto cycles = begin(folder + "/navigation.csv", kCycleHeader);
    if (!cycles) return cycles.error();
    auto measurements = begin(folder + "/measurements.csv", kMeasurementHeader);
    if (!measurements) return measurements.error();
    log->cycles_ = *std::move(cycles);
    log->measurements_ = *std::move(measurements);
    return log;
}

void NavigationLog::frame(const Camera& camera, std::span<const std::uint8_t> bytes) {
    const std::lock_guard lock(mutex_);
    LastFrame& seen = seen_[camera.name];
    seen.camera = camera;
    seen.bytes.assign(bytes.begin(), bytes.end());
}

void NavigationLog::cycle(const CycleRecord& r) {
    for (const MeasurementRecord& s : r.measurements) {
        const auto outcome = static_cast<std::size_t>(s.outcome);
        ++outcomes_[s.sensor][outcome];
        measurements_ << fmt::format("{},{},{},{:.3f},{},{:.2f},{},\"{}\"\n", s.t_ns, s.sensor,
                                     kMeasurementOutcomes[outcome], s.nis, s.points, s.ms,
                                     kAnswerKinds[static_cast<std::size_t>(s.answer)], s.why);
    }
    const Rigid3& port = r.port.T_port_chaser_port;
    const auto phase = static_cast<std::size_t>(r.command.phase), abort = static_cast<std::size_t>(r.command.abort);
    cycles_ << fmt::format("{},{},{:.6f},{},{},{},{},{},{},{},{:.5f},{:.6g},{},{},{},{},{},{}\n", r.estimate.cycle,
                           r.estimate.t_ns, r.t_s, kGuidancePhases[phase], r.command.leg, kAbortReasons[abort],
                           csv_numbers(port.t, "{:.5f}"), csv_numbers(r.port.velocity_m_s),
                           csv_numbers(r.reference.position_m, "{:.5f}"),
                           csv_numbers(port.t - r.reference.position_m),
                           angle_between(port.q, r.reference.q_port_chaser_port) / kDegree, r.position_sigma_m,
                           csv_numbers(r.estimate.sigma_position_m),
                           csv_numbers(r.estimate.sigma_rotation_rad / kDegree), csv_numbers(r.command.impulse_n_s),
                           csv_numbers(r.command.angular_impulse_n_m_s), r.estimate.frames, r.estimate.sweeps);

    const bool changed = r.command.phase != phase_ || r.command.abort != abort_;
    phase_ = r.command.phase, abort_ = r.command.abort;
    if (!changed) return;
    if (phase_ == GuidancePhase::holding) pictures("hold_" + file_name_part(legs_[r.command.leg]));
    if (phase_ == GuidancePhase::docked || phase_ == GuidancePhase::landed) pictures("contact");
    if (abort_ != AbortReason::none) pictures("abort");
}

void NavigationLog::pictures(const std::string& name) {
    const std::lock_guard lock(mutex_);
    for (const auto& [camera, seen] : seen_) {
        const RadianceImage none(seen.camera.width, seen.camera.height);
        const auto written = write_image(folder_ + "/" + name + "_" + camera + ".png",
                                         RenderedFrame{seen.camera, none, nullptr, seen.bytes});
        if (!written && pictures_written_) pictures_written_ = written.error();
    }
}

Status NavigationLog::finish(const NodeCounts& c, std::uint64_t restarts, const std::string& version) {
    nlohmann::json sensors = nlohmann::json::object();
    for (const auto& [sensor, counts] : outcomes_)
        for (std::size_t i = 0; i < counts.size(); ++i)
            sensors[sensor][std::string(kMeasurementOutcomes[i])] = counts[i];
    const nlohmann::json document{
        {"version", version},
        {"cycles", c.cycles},
        {"cycles_late", c.cycles_late},
        {"cycles_passed_over", c.cycles_passed_over},
        {"frames", c.frames},
        {"frames_missing", c.frames_missing},
        {"packets", c.packets},
        {"packets_bad", c.packets_bad},
        {"turns_incomplete", c.turns_incomplete},
        {"bad_messages", c.bad_messages},
        {"send_drops", c.send_drops},
        {"filter_restarts", restarts},
        {"phase", kGuidancePhases[static_cast<std::size_t>(phase_)]},
        {"abort", kAbortReasons[static_cast<std::size_t>(abort_)]},
        {"sensors", sensors},
    };
    std::ofstream file(folder_ + "/navigation.json");
    file << document.dump(2, ' ', false, nlohmann::json::error_handler_t::replace) << "\n";
    if (!file.flush()) return Error{"cannot be written", folder_ + "/navigation.json"};
    if (!cycles_.flush() || !measurements_.flush()) return Error{"cannot be written", folder_ + "/navigation.csv"};
    return pictures_written_;
}

}  // namespace narpa::rehearsal
