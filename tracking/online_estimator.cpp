#include "tracking/online_estimator.h"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "emulator/bus/can_node.h"
#include "emulator/log/mcap_log.h"
#include "tracking/estimate_report.h"

namespace narpa {

OnlineEstimator::OnlineEstimator(std::unique_ptr<FrameTracker> tracker, const World& world, std::size_t camera,
                                 bool lockstep)
    : tracker_(std::move(tracker)),
      index_(camera),
      camera_(world.scene().cameras[camera].name),
      target_(world.scene().bodies[tracker_->target()].name),
      title_(fmt::format("{}: {} seen by {}, by {}", world.scene().name, target_, camera_,
                         tracker_->options().method->name)),
      camera_frame_(frame_of(world.scene().cameras[camera])),
      target_frame_(frame_of(world.scene().bodies[tracker_->target()])) {
    if (!lockstep) single_threaded_.emplace();
}

std::string OnlineEstimator::description() const {
    return fmt::format("pose of {} from camera {}", target_, camera_);
}

Status OnlineEstimator::log_to(const std::string& folder, bool wait_when_full) {
    stem_ = folder + "/" + camera_ + ".estimate";
    auto log = RowLog::create(stem_ + ".csv", std::string(kEstimateHeader) + "\n", wait_when_full);
    if (!log) return log.error();
    log_ = *std::move(log);
    return Ok{};
}

void OnlineEstimator::record_to(McapLog& log) {
    constexpr std::size_t kMessageBytes = 2048;
    mcap_ = &log.source(kMessageBytes);
    estimate_channel_ = log.add_channel<foxglove::Estimate>("/" + camera_frame_ + "/estimate");
    pose_channel_ = log.add_channel<foxglove::PoseInFrame>("/" + camera_frame_ + "/estimate/pose");
}

void OnlineEstimator::record(const TrackedFrame& tracked, std::int64_t t_publish_ns) {
    const auto send = [&](std::uint16_t channel, const auto& message) {
        std::vector<std::uint8_t> encoded;
        encode_proto(message, encoded);
        mcap_->message(channel, tracked.t_ns, t_publish_ns, encoded);
    };
    const auto rows = [](const Matrix6& m) {
        std::vector<double> numbers;
        for (int i = 0; i < 36; ++i) numbers.push_back(m(i / 6, i % 6));
        return numbers;
    };
    foxglove::Estimate message{.timestamp = foxglove::timestamp(tracked.t_ns),
                               .frame_id = camera_frame_,
                               .target = target_frame_,
                               .frame = tracked.frame,
                               .state = std::string(kEstimateStates[static_cast<std::size_t>(tracked.state)]),
                               .answer = std::string(kAnswerKinds[static_cast<std::size_t>(tracked.answer.kind)])};
    if (tracked.state != EstimateState::lost) {
        message.pose = to_foxglove(tracked.filtered);
        message.covariance = rows(tracked.filtered_covariance);
        send(pose_channel_, foxglove::PoseInFrame{message.timestamp, camera_frame_, *message.pose});
    }
    if (tracked.measured) {
        message.measured = to_foxglove(*tracked.measured);
        message.measured_covariance = rows(tracked.covariance);
    }
    send(estimate_channel_, message);
}

void OnlineEstimator::observe(const FrameLedger& ledger, std::span<const std::uint8_t> bytes, const BodyPoses& at) {
    TrackedFrame tracked = tracker_->take(ledger, bytes, at);
    (void)reports_.push(tracked.report(static_cast<std::uint8_t>(index_)));
    if (log_) log_->append(estimate_row(tracked));
    if (mcap_) record(tracked, ledger.t_hand_over_ns);
    if (frames_.size() < kMaxKept) frames_.push_back(std::move(tracked));
}

void OnlineEstimator::send_telemetry(CanNode& can, std::int64_t t_ns) noexcept {
    for (EstimateReport report; reports_.pop(report);) can.send(report, t_ns);
}

Status OnlineEstimator::finish() {
    if (!log_) return Ok{};
    if (auto closed = log_->close(); !closed) return closed;
    return plot_estimates(stem_ + ".png", title_, frames_);
}

nlohmann::json OnlineEstimator::report(std::uint64_t skipped) const {
    return {{"camera", camera_},
            {"target", target_},
            {"passed_over", skipped},
            {"summary", to_json(summarise(frames_))}};
}

std::string OnlineEstimator::to_text(std::uint64_t skipped) const {
    return fmt::format("  estimate of {} from camera {}: {} frames skipped; {}", target_, camera_, skipped,
                       narpa::to_text(summarise(frames_)));
}

OpenFrameObserver estimate_from(const std::string& camera, const TrackerOptions& options,
                                const OnlineEstimator** made) {
    return [=](const World& world, std::span<const std::size_t> cameras,
               bool lockstep) -> Result<std::unique_ptr<FrameObserver>> {
        if (cameras.empty())
            return Error{"--estimate needs a camera, expected --video CAMERA=SINK too (SINK may be none)"};
        const Scene& scene = world.scene();
        const auto index = camera.empty() ? Result<std::size_t>(cameras.front())
                                          : sensor_named(scene.cameras, camera, "camera", scene.file);
        if (!index) return index.error();
        if (std::ranges::find(cameras, *index) == cameras.end())
            return Error{fmt::format("--estimate {}: this camera has no sink, expected --video {}=SINK too", camera,
                                     camera)};
        auto tracker = FrameTracker::create(world, *index, options);
        if (!tracker) return tracker.error();
        auto estimator = std::make_unique<OnlineEstimator>(*std::move(tracker), world, *index, lockstep);
        if (made) *made = estimator.get();
        return std::unique_ptr<FrameObserver>(std::move(estimator));
    };
}

}  // namespace narpa
