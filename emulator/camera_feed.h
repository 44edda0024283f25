/// emulator/camera_feed.h - a camera on its way out: unit -> sinks, log, ledger, with everything counted.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "drivers/video/video_sink.h"
#include "emulator/camera_unit.h"
#include "emulator/clock.h"
#include "emulator/estimate_feed.h"
#include "emulator/log/contact_sheet.h"
#include "emulator/log/histogram.h"
#include "emulator/log/row_log.h"
#include "emulator/spsc_ring.h"

namespace narpa {

struct CameraStats {
    std::uint64_t frames = 0;       ///< exposed
    std::uint64_t handed_over = 0;  ///< given to the sinks
    std::uint64_t skipped = 0;      ///< never exposed: the one before took too long
    std::uint64_t deadline_missed = 0;
    std::uint64_t stale = 0;                               ///< frames that show a body without a fresh command
    std::uint64_t repeated = 0, blanked = 0;               ///< handed over in place of late frames
    std::uint64_t ledgers_lost = 0;                        ///< the CAN thread did not keep up
    std::array<std::uint64_t, kStepNames.size()> steps{};  ///< frames that got so far
    Histogram wake_late, render, hand_over;  ///< after it was due; duration; from mid-exposure to hand-over
    Histogram radiance, sensor, send;        ///< parts of it: durations
    SignedHistogram late;              ///< hand-over (of what is late and dropped: its end) after the deadline
    Histogram error_1e9, samples_1e3;  ///< expected error, 1e-9 of full scale; samples per pixel, 1e-3
};

class CameraFeed {
public:
    CameraFeed(const World& world, std::size_t camera, std::vector<std::unique_ptr<VideoSink>> sinks);

    /// Truth (trajectory CSV), ledger (CSV) and contact sheet in this folder.
    Status log_to(const std::string& folder, bool wait_when_full);

    /// The first frame at or after this time is next.
    void start_at(std::int64_t t_ns) noexcept;
    [[nodiscard]] std::int64_t next_mid_ns() const noexcept { return unit_.t_mid_ns(next_); }
    /// When the next frame can be made: its exposure is over.
    [[nodiscard]] std::int64_t due_ns() const noexcept { return next_mid_ns() + unit_.exposure_ns() / 2; }

    /// Makes three frames for nobody: two that take all that frames of this scene can take pay for what is needed
    /// once, and the faster of them shows how fast the renderer is; the third shows what the next need on their way
    /// out.
    void warm_up();
    /// Exposes the next frame and hands it to every sink. `clock`: null in lockstep, where no wall time enters.
    /// `end_ns`: frames from there on are not part of the run, so they cannot be skipped.
    void make_next(const Clock* clock, std::int64_t end_ns);

    [[nodiscard]] const CameraUnit& unit() const noexcept { return unit_; }
    [[nodiscard]] const CameraStats& stats() const noexcept { return stats_; }
    [[nodiscard]] const std::vector<std::unique_ptr<VideoSink>>& sinks() const noexcept { return sinks_; }
    /// Ledgers for the CAN thread: kept only where there is one.
    void keep_ledgers() noexcept { keeps_ledgers_ = true; }
    SpscRing<FrameLedger, 64>& ledgers() noexcept { return ledgers_; }
    /// Who looks at the frames as they go out; outlives the run.
    void show_to(EstimateFeed& watcher) noexcept { watcher_ = &watcher; }
    /// Flushes sinks and logs and writes the contact sheet.
    Status finish();

private:
    void hand_over(FrameLedger& ledger, const Clock* clock) noexcept;
    /// For the hand-over: the end of the time budget, or the middle of the next exposure.
    [[nodiscard]] std::int64_t deadline_ns(std::uint32_t frame) const noexcept;
    [[nodiscard]] Delivery deliver(bool in_time) noexcept;
    void send(std::span<const std::uint8_t> bytes) noexcept;
    void account(const FrameLedger& ledger) noexcept;
    void let_go_of_missed(const Clock& clock, std::int64_t end_ns) noexcept;
    void log(const FrameLedger& ledger) noexcept;
    void show(const FrameLedger& ledger, bool real_time);

    const World& world_;
    CameraUnit unit_;
    std::vector<std::unique_ptr<VideoSink>> sinks_;
    std::uint32_t next_ = 0;
    std::vector<std::uint8_t> spare_;  ///< `repeat`: the last frame in time; `blank`: black; else empty
    SpscRing<FrameLedger, 64> ledgers_;
    bool keeps_ledgers_ = false;
    EstimateFeed* watcher_ = nullptr;
    CameraStats stats_;

    std::string folder_;
    std::unique_ptr<RowLog> truth_log_, ledger_log_;
    std::unique_ptr<ContactSheet> sheet_;
};

}  // namespace narpa
