// The statistics of a camera as JSON and as text.
#include <fmt/format.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "emulator/camera/camera_sensor.h"
#include "emulator/log/statistics.h"

namespace narpa {
namespace {

using nlohmann::json;

/// Shares of a camera's frames: beyond the first, skipped or late ones call for advice; a run that skips more than
/// the second has failed.
constexpr double kAdvisedShare = 0.01, kSkippedShareMax = 0.5;

Counts steps_of(const CameraStats& s) {
    Counts steps;
    for (std::size_t i = 0; i < kStepNames.size(); ++i) steps.emplace_back(kStepNames[i], s.steps[i]);
    return steps;
}

Counts drops_of(const VideoCounters& c) {
    return {{"ring full", c.ring_full}, {"no reader", c.no_reader}, {"failed", c.failed}};
}

}  // namespace

json CameraSensor::report() const {
    const CameraStats& s = stats_;
    json sinks = json::array();
    for (const auto& sink : sinks_) {
        const VideoCounters c = sink->counters();
        sinks.push_back(to_json(drops_of(c), "dropped_"));
        sinks.back().update({{"sink", sink->description()}, {"written", c.written}, {"reconnects", c.reconnects}});
    }
    json control = nullptr;
    if (control_) {
        const CameraControlCounters c = control_->counters();
        control = {{"commands", c.commands},
                   {"commands_refused", c.commands_refused},
                   {"triggers", c.triggers},
                   {"triggers_refused", c.triggers_refused},
                   {"triggers_dropped", c.triggers_dropped},
                   {"states_lost", s.states_lost}};
    }
    return {{"name", name()},
            {"control", control},
            {"frames", s.frames},
            {"handed_over", s.handed_over},
            {"not_taken", s.not_taken},
            {"skipped", s.skipped},
            {"deadlines_missed", s.deadline_missed},
            {"stale", s.stale},
            {"ledgers_lost", s.ledgers_lost},
            {"repeated", s.repeated},
            {"blanked", s.blanked},
            {"steps", to_json(steps_of(s))},
            {"samples_per_pixel", percentiles(s.samples_1e3, 1e-3)},
            {"expected_error", s.error_1e9.count() > 0 ? percentiles(s.error_1e9, 1e-9) : json(nullptr)},
            {"hand_over_after_deadline_ms", lateness(s.late)},
            {"wake_late_ms", percentiles(s.wake_late, 1e-6)},
            {"render_ms", percentiles(s.render, 1e-6)},
            {"mid_exposure_to_hand_over_ms", percentiles(s.hand_over, 1e-6)},
            {"sinks", sinks}};
}

std::string CameraSensor::to_text(bool lockstep) const {
    const CameraStats& s = stats_;
    const auto late = [&](double p) { return against_deadline(s.late.percentile_ns(p) * 1e-6); };
    std::string out =
        fmt::format("  camera {}: {} frames, {} handed over, {}{} skipped, {}{} stale\n", name(), s.frames,
                    s.handed_over, s.not_taken > 0 ? fmt::format("{} taken by no sink, ", s.not_taken) : "",
                    s.skipped, lockstep ? "" : fmt::format("{} deadlines missed, ", s.deadline_missed), s.stale);
    out += fmt::format("    p50 / p99 / max: render {}", latency_text(s.render));
    if (!lockstep) {  // in lockstep there are no deadlines
        out += fmt::format("; mid-exposure to hand-over {}; wake-up latency {}", latency_text(s.hand_over),
                           latency_text(s.wake_late));
        out += fmt::format(
            "\n    hand-over, from the deadline: p50 {}, p90 {}, p99 {}, p99.9 {}, latest {}; repeated {}, blank "
            "{}\n"
            "    frames: {}",
            late(0.5), late(0.9), late(0.99), late(0.999), late(1), s.repeated, s.blanked, lateness_text(s.late));
    }
    out += "\n";
    out +=
        fmt::format("    steps: {}; samples per pixel p50 {:.2f}, max {:.2f} ({})", non_zero(steps_of(s)),
                    s.samples_1e3.percentile_ns(0.5) * 1e-3, s.samples_1e3.max_ns() * 1e-3, kSamplesPerPixelNote);
    if (s.error_1e9.count() > 0)
        out += fmt::format("; expected error p50 {:.3g}, p99 {:.3g}, max {:.3g} of full scale",
                           s.error_1e9.percentile_ns(0.5) * 1e-9, s.error_1e9.percentile_ns(0.99) * 1e-9,
                           s.error_1e9.max_ns() * 1e-9);
    out += "\n";
    if (control_) {
        const CameraControlCounters c = control_->counters();
        out += fmt::format("    commands: {} accepted, {} refused; triggers: {} accepted, {} refused, {} dropped\n",
                           c.commands, c.commands_refused, c.triggers, c.triggers_refused, c.triggers_dropped);
    }
    for (const auto& sink : sinks_) {
        const VideoCounters c = sink->counters();
        out +=
            fmt::format("    -> {}: {} written, {}\n", sink->description(), c.written, dropped_text(drops_of(c)));
    }
    return out;
}

std::string CameraSensor::progress() const {
    const float error = shown_.expected_error;
    return fmt::format("{}: {} late, {} skipped, {:.2f} samples/pixel{}", name(), shown_.late.load(),
                       shown_.skipped.load(), shown_.samples_per_pixel.load(),
                       error < 0 ? "" : fmt::format(", error {:.2g}", error));
}

std::string CameraSensor::failure() const {
    const std::uint64_t due = stats_.frames + stats_.skipped, missed = stats_.skipped + stats_.deadline_missed;
    if (late_max_ && share(missed, due) > *late_max_)
        return fmt::format("camera {}: {} of {} frames were late or skipped, expected at most {:g} %", name(),
                           missed, due, 100 * *late_max_);
    if (share(stats_.skipped, stats_.frames + stats_.skipped) <= kSkippedShareMax) return {};
    return fmt::format("a camera skipped more than {:g} % of its frames", 100 * kSkippedShareMax);
}

std::string CameraSensor::advice() const {
    const CameraStats& s = stats_;
    const std::int64_t budget_ns = world_.scene().render.budget_ns;
    const std::uint64_t due = s.frames + s.skipped;
    const double period_ms = static_cast<double>(world_.scene().cameras[index_].period_ns) * 1e-6;
    if (share(s.skipped + s.deadline_missed, due) <= kAdvisedShare) return {};
    const double needs_ms = s.render.percentile_ns(0.99) * 1e-6;  // includes the detector
    std::string text = fmt::format("camera {}: {} of {} frames were skipped and {} late. ", name(), s.skipped, due,
                                   s.deadline_missed);
    if (budget_ns > 0 && static_cast<double>(budget_ns) * 1e-6 < 0.9 * period_ms && s.skipped == 0)
        return text + "Give it more time (--budget-ms, at most the period), or less load beside it";
    return text + fmt::format(
                      "A frame takes {:.1f} ms (p99) and one is due every {:.1f} ms: expected --budget-ms {:.2g}, "
                      "fewer --spp or --budget-rays, or rate_hz at most {:.2g}",
                      needs_ms, period_ms, 0.6 * period_ms, std::max(0.1, 800 / std::max(needs_ms, 1e-3)));
}

}  // namespace narpa
