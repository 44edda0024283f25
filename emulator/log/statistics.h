/// emulator/log/statistics.h - statistics as JSON and as text, for the reports of runs, replays and benches.
#pragma once

#include <array>
#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "emulator/log/histogram.h"

namespace narpa {

/// Percentiles of reports, with their names in JSON.
inline constexpr std::array<std::pair<const char*, double>, 5> kPercentiles{
    {{"p50", 0.5}, {"p90", 0.9}, {"p99", 0.99}, {"p99.9", 0.999}, {"max", 1.0}}};
/// Percentiles of a Histogram or SignedHistogram by those names, each times `unit` (1e-6: in ms).
template <class H>
[[nodiscard]] nlohmann::json percentiles(const H& histogram, double unit);

/// Median, 99th percentile and maximum: "1.20 / 3.40 / 5.60 ms".
[[nodiscard]] std::string latency_text(const Histogram& h);

/// Numbers of events by their causes.
using Counts = std::vector<std::pair<std::string_view, std::uint64_t>>;
/// An object; keys have `prefix` and the cause, with _ for spaces.
[[nodiscard]] nlohmann::json to_json(const Counts& counts, std::string_view prefix = "");
/// "3 bad_checksum, 1 past", or "none".
[[nodiscard]] std::string non_zero(const Counts& counts);
/// "2 dropped (1 ring full, 1 no reader)", "0 dropped".
[[nodiscard]] std::string dropped_text(const Counts& causes);

/// A part of a whole; 0 of nothing.
[[nodiscard]] constexpr double share(std::uint64_t part, std::uint64_t whole) noexcept {
    return whole > 0 ? static_cast<double>(part) / static_cast<double>(whole) : 0;
}

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
