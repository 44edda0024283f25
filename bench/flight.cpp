#include "bench/flight.h"

#include <fmt/format.h>
#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <map>
#include <nlohmann/json.hpp>

#include "bench/statistics.h"
#include "protocols/can/candump.h"
#include "protocols/can/messages/pose_command.h"

namespace narpa {
namespace {

constexpr std::int64_t kLead_ns = 100'000'000;

/// The frames of a range.
struct Range {
    std::vector<double> hand_over_ms, samples, error;  ///< error: where it is known
    std::size_t frames = 0, late = 0;
    std::array<std::size_t, kStepNames.size()> steps{};
};

/// By the binary logarithm of their lower ends, the farthest first.
std::map<int, Range, std::greater<>> ranges_of(const Flown& frames) {
    std::map<int, Range, std::greater<>> ranges;
    for (const FlownFrame& f : frames) {
        Range& r = ranges[static_cast<int>(std::floor(std::log2(std::max(f.range_m, 1e-3))))];
        ++r.frames, r.late += f.late, ++r.steps[f.step];
        r.hand_over_ms.push_back(f.hand_over_ms), r.samples.push_back(f.samples_per_pixel);
        if (f.expected_error >= 0) r.error.push_back(f.expected_error);
    }
    return ranges;
}

class FlightObserver final : public FrameObserver {
public:
    FlightObserver(const World& world, std::size_t camera, std::string name, std::shared_ptr<Flown> out)
        : world_(world), camera_(camera), name_(std::move(name)), out_(std::move(out)) {}

    [[nodiscard]] std::string_view name() const noexcept override { return name_; }
    [[nodiscard]] std::string description() const override { return "frames by range"; }
    [[nodiscard]] std::size_t camera() const noexcept override { return camera_; }
    void observe(const FrameLedger& l, std::span<const std::uint8_t>, const BodyPoses& at) override {
        const Camera& camera = world_.scene().cameras[camera_];
        const double t_s = static_cast<double>(l.t_exposure_mid_ns) * 1e-9;
        const Vec3 eye = world_.camera_pose(camera, t_s, at).t;
        double range_m = 1e12;
        for (std::size_t body = 0; body < at.T_world_body.size(); ++body)
            if (static_cast<int>(body) != camera.mount)
                range_m = std::min(range_m, norm(at.T_world_body[body].t - eye));
        out_->push_back({range_m, !l.deadline_met, l.step,
                         static_cast<double>(l.t_hand_over_ns - l.t_exposure_mid_ns) * 1e-6,
                         static_cast<double>(l.samples_per_pixel), static_cast<double>(l.expected_error)});
    }
    [[nodiscard]] nlohmann::json report(std::uint64_t skipped) const override { return {{"skipped", skipped}}; }
    [[nodiscard]] std::string to_text(std::uint64_t) const override { return {}; }

private:
    const World& world_;
    std::size_t camera_;
    std::string name_;
    std::shared_ptr<Flown> out_;
};

Result<std::map<std::string, std::uint32_t>> identifiers(const Scene& scene, const std::string& path,
                                                         const std::vector<TrajectoryRow>& rows) {
    std::map<std::string, std::uint32_t> ids;
    for (const TrajectoryRow& row : rows) {
        const auto body = std::find_if(scene.bodies.begin(), scene.bodies.end(),
                                       [&](const Body& b) { return b.name == row.body; });
        if (body == scene.bodies.end() || !body->can_id)
            return Error{fmt::format("body \"{}\": expected a body of {} with a can_id", row.body, scene.file),
                         path, row.line};
        ids.emplace(row.body, *body->can_id);
    }
    return ids;
}

}  // namespace

std::vector<TrajectoryRow> there_and_back(std::vector<TrajectoryRow> rows) {
    std::stable_sort(rows.begin(), rows.end(), [](const auto& a, const auto& b) { return a.t_ns < b.t_ns; });
    if (rows.empty()) return rows;
    const std::int64_t first_ns = rows.front().t_ns, length_ns = rows.back().t_ns - first_ns;
    for (TrajectoryRow& row : rows) row.t_ns -= first_ns;
    for (std::size_t i = rows.size(); i-- > 0;) {
        TrajectoryRow back = rows[i];
        if (back.t_ns == length_ns) continue;  // the turning point is there already
        back.t_ns = 2 * length_ns - back.t_ns;
        back.motion.velocity_m_s = -back.motion.velocity_m_s;
        back.motion.rate_rad_s = -back.motion.rate_rad_s;
        rows.push_back(std::move(back));
    }
    return rows;
}

std::vector<TrajectoryRow> repeated(std::vector<TrajectoryRow> flight, std::int64_t until_ns) {
    const std::size_t rows = flight.size();
    const std::int64_t period_ns = rows > 0 ? flight.back().t_ns : 0;
    for (std::int64_t start_ns = period_ns; period_ns > 0 && start_ns < until_ns; start_ns += period_ns)
        for (std::size_t i = 0; i < rows; ++i) {
            if (flight[i].t_ns == 0) continue;  // the end of the flight before
            flight.push_back(flight[i]);
            flight.back().t_ns += start_ns;
        }
    return flight;
}

Result<RecordedFlight> RecordedFlight::create(const Scene& scene, const std::string& path,
                                              const std::vector<TrajectoryRow>& rows) {
    auto ids = identifiers(scene, path, rows);
    if (!ids) return ids.error();
    RecordedFlight flight(::memfd_create("narpa-flight", MFD_CLOEXEC));
    if (flight.fd_ < 0) return Error{fmt::format("no memory for the flight: {}", std::strerror(errno)), path};
    std::map<std::string, std::uint8_t> counters;
    std::string text;
    for (const TrajectoryRow& row : rows) {
        FrameSet frames;
        const PoseCommand command{counters[row.body]++, row.t_ns, row.motion};
        if (const EncodeStatus encoded = encode(command, ids->at(row.body), true, frames); !encoded)
            return Error{fmt::format("body \"{}\": {}", row.body, encoded.text()), path, row.line};
        for (const CanFrame& frame : frames) {
            std::array<char, kCandumpMaxLine> line;
            // Times count from the first line.
            const CandumpLine at{std::max<std::int64_t>(row.t_ns - kLead_ns, 0), frame};
            text.append(line.data(), format_candump(at, "narpa", line));
        }
    }
    for (std::size_t written = 0; written < text.size();) {
        const ssize_t n = ::write(flight.fd_, text.data() + written, text.size() - written);
        if (n <= 0) return Error{fmt::format("no memory for the flight: {}", std::strerror(errno)), path};
        written += static_cast<std::size_t>(n);
    }
    return flight;
}

RecordedFlight::~RecordedFlight() {
    if (fd_ >= 0) ::close(fd_);
}

std::string RecordedFlight::bus() const {
    return fmt::format("log:/proc/self/fd/{}", fd_);
}

OpenFrameObserver watch_flight(std::size_t camera, std::shared_ptr<Flown> out) {
    return [camera, out](const World& world, std::span<const std::size_t> cameras,
                         bool) -> Result<std::unique_ptr<FrameObserver>> {
        if (camera >= cameras.size()) return Error{fmt::format("camera {} does not run", camera)};
        return std::unique_ptr<FrameObserver>(
            std::make_unique<FlightObserver>(world, cameras[camera], fmt::format("flight{}", camera), out));
    };
}

nlohmann::json by_range(const Flown& frames) {
    nlohmann::json out = nlohmann::json::array();
    for (const auto& [octave, r] : ranges_of(frames)) {
        nlohmann::json steps;
        for (std::size_t i = 0; i < r.steps.size(); ++i)
            if (r.steps[i] > 0) steps[std::string(kStepNames[i])] = r.steps[i];
        nlohmann::json error;  // null: unknown
        if (!r.error.empty()) error = {{"p50", quantile(r.error, 0.5)}, {"max", quantile(r.error, 1)}};
        out.push_back({{"from_m", std::exp2(octave)},
                       {"to_m", std::exp2(octave + 1)},
                       {"frames", r.frames},
                       {"late", r.late},
                       {"steps", steps},
                       {"mid_exposure_to_hand_over_ms",
                        {{"p50", quantile(r.hand_over_ms, 0.5)}, {"max", quantile(r.hand_over_ms, 1)}}},
                       {"samples_per_pixel", {{"p50", quantile(r.samples, 0.5)}, {"min", quantile(r.samples, 0)}}},
                       {"expected_error", error}});
    }
    return out;
}

std::string by_range_text(const Flown& frames) {
    std::string out = fmt::format("{:>16} {:>7} {:>5} {:>24} {:>22} {:>22}  steps\n", "range, m", "frames", "late",
                                  "mid-exposure to out, ms", "samples per pixel", "expected error, %");
    out += fmt::format("{:>16} {:>7} {:>5} {:>24} {:>22} {:>22}\n", "", "", "", "p50 / max", "p50 / least",
                       "p50 / max");
    for (const auto& [octave, r] : ranges_of(frames)) {
        std::string steps;
        for (std::size_t i = 0; i < r.steps.size(); ++i)
            if (r.steps[i] > 0)
                steps += fmt::format("{}{} {}", steps.empty() ? "" : ", ", r.steps[i], kStepNames[i]);
        out += fmt::format(
            "{:>16} {:>7} {:>5} {:>24} {:>22} {:>22}  {}\n",
            fmt::format("{:g} to {:g}", std::exp2(octave), std::exp2(octave + 1)), r.frames, r.late,
            fmt::format("{:.1f} / {:.1f}", quantile(r.hand_over_ms, 0.5), quantile(r.hand_over_ms, 1)),
            fmt::format("{:.2f} / {:.2f}", quantile(r.samples, 0.5), quantile(r.samples, 0)),
            r.error.empty()
                ? "unknown"
                : fmt::format("{:.1f} / {:.1f}", 100 * quantile(r.error, 0.5), 100 * quantile(r.error, 1)),
            steps);
    }
    return out;
}

}  // namespace narpa
