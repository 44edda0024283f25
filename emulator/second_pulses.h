/// emulator/second_pulses.h - one pulse per second (PPS) on a line: it rises with each whole second of the run's
/// UTC.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <string>

#include "base/stop.h"
#include "drivers/pulse/pulse_sink.h"
#include "emulator/clock.h"
#include "emulator/log/histogram.h"

namespace narpa {

class SecondPulses {
public:
    static constexpr std::int64_t kHigh_ns = 100'000'000;  ///< half of that at least after a late start

    explicit SecondPulses(std::unique_ptr<PulseSink> line) : line_(std::move(line)) {}

    /// On a thread of its own, until `stop`. The line is low at the end.
    void run(const RealTimeClock& clock, const StopFlag& stop) noexcept;

    // After `run`.

    [[nodiscard]] std::string description() const { return line_->description(); }
    /// From the whole second to the return of the driver that has set the line.
    [[nodiscard]] const Histogram& late() const noexcept { return late_; }
    [[nodiscard]] std::uint64_t failed() const noexcept { return failed_; }

private:
    std::unique_ptr<PulseSink> line_;
    Histogram late_{};
    std::uint64_t failed_ = 0;
};

}  // namespace narpa
