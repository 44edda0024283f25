/// emulator/report.h - how a run went: as one JSON document for programs, as a few lines for people.
#pragma once

#include <array>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "emulator/emulator.h"
#include "emulator/log/histogram.h"

namespace narpa {

/// Frames, sweeps, commands received and lost, latency percentiles, deadlines missed, drops by cause. Each sensor's
/// part is in the list of its kind ("cameras").
[[nodiscard]] nlohmann::json report(const Emulator& emulator);
/// The same as text.
[[nodiscard]] std::string to_text(const Emulator& emulator);

/// Percentiles of reports, with their names in JSON.
inline constexpr std::array<std::pair<const char*, double>, 5> kPercentiles{
    {{"p50", 0.5}, {"p90", 0.9}, {"p99", 0.99}, {"p99.9", 0.999}, {"max", 1.0}}};
/// Percentiles of a Histogram or SignedHistogram by those names, each times `unit` (1e-6: in ms).
template <class H>
[[nodiscard]] nlohmann::json percentiles(const H& histogram, double unit);

/// Why a run has failed, a sentence each: a camera skipped more than half of its frames, or a lockstep run made no
/// frame and no packet. Empty: it has passed.
[[nodiscard]] std::vector<std::string> failures(const Emulator& emulator);
/// For each camera that skipped frames or was late: how much, and which budget or rate to change.
[[nodiscard]] std::vector<std::string> advice(const Emulator& emulator);

/// Number of frames by the time from their deadline to the hand-over (negative: before).
struct LatenessBin {
    double from_ms, to_ms;  ///< infinite at either end
    std::uint64_t frames;
};
[[nodiscard]] std::vector<LatenessBin> lateness_bins(const SignedHistogram& late);
/// Percentiles and bins.
[[nodiscard]] nlohmann::json lateness(const SignedHistogram& late);
/// "1.69 ms before", "0.30 ms after".
[[nodiscard]] std::string against_deadline(double late_ms);
/// "598 1 to 3 ms early, 2 0.3 to 1 ms late": the bins that are not empty.
[[nodiscard]] std::string lateness_text(const SignedHistogram& late);

/// Note beside a number of samples per pixel: how it is counted.
inline constexpr const char* kSamplesPerPixelNote = "mean of all pixels; tiles without a body take none";

}  // namespace narpa
