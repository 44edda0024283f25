#include "emulator/online_estimator.h"

#include <fmt/format.h>

#include <algorithm>

#include "emulator/log/estimate_report.h"

namespace narpa {

OnlineEstimator::OnlineEstimator(std::unique_ptr<FrameTracker> tracker, const World& world, std::size_t camera,
                                 bool lockstep)
    : tracker_(std::move(tracker)),
      camera_(world.scene().cameras[camera]),
      index_(static_cast<std::uint8_t>(camera)),
      target_(world.scene().bodies[tracker_->target()].name),
      title_(fmt::format("{}: {} seen by {}, by {}", world.scene().name, target_, camera_.name,
                         tracker_->options().method->name)),
      lockstep_(lockstep),
      bytes_(frame_bytes({camera_.width, camera_.height, camera_.format, camera_.period_ns})),
      at_(world.scene().bodies.size()) {}

Status OnlineEstimator::log_to(const std::string& folder) {
    stem_ = folder + "/" + camera_.name + ".estimate";
    auto log = RowLog::create(stem_ + ".csv", std::string(kEstimateHeader) + "\n", lockstep_);
    if (!log) return log.error();
    log_ = *std::move(log);
    return Ok{};
}

void OnlineEstimator::take(const FrameLedger& ledger, std::span<const std::uint8_t> bytes, const BodyPoses& at) {
    if (lockstep_) return process(ledger, bytes, at);
    if (slot_.load(std::memory_order_acquire) != empty) {
        ++skipped_;
        return;
    }
    ledger_ = ledger;
    std::copy(bytes.begin(), bytes.end(), bytes_.begin());
    at_ = at;  // allocates nothing: of as many bodies
    slot_.store(full, std::memory_order_release);
    slot_.notify_one();
}

void OnlineEstimator::run(const StopFlag& stop) {
    while (!stop.load(std::memory_order_acquire)) {
        slot_.wait(empty, std::memory_order_acquire);
        if (stop.load(std::memory_order_acquire)) return;
        process(ledger_, bytes_, at_);
        // A `wake` meanwhile is lost, but `stop` was set before it and is checked next.
        (void)slot_.exchange(empty, std::memory_order_acq_rel);
    }
}

void OnlineEstimator::wake() noexcept {
    slot_.store(full, std::memory_order_release);
    slot_.notify_one();
}

void OnlineEstimator::process(const FrameLedger& ledger, std::span<const std::uint8_t> bytes, const BodyPoses& at) {
    TrackedFrame tracked = tracker_->take(ledger, bytes, at);
    if (keeps_reports_) (void)reports_.push(tracked.report(index_));
    if (log_) log_->append(estimate_row(tracked));
    if (frames_.size() < kMaxKept) frames_.push_back(std::move(tracked));
}

Status OnlineEstimator::finish() {
    if (!log_) return Ok{};
    if (auto closed = log_->close(); !closed) return closed;
    return plot_estimates(stem_ + ".png", title_, frames_);
}

}  // namespace narpa
