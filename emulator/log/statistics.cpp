#include "emulator/log/statistics.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "base/constants.h"

namespace narpa {

using nlohmann::json;

template <class H>
json percentiles(const H& h, double unit) {
    json out = json::object();
    for (const auto& [name, p] : kPercentiles) out[name] = h.percentile_ns(p) * unit;
    return out;
}
template json percentiles(const Histogram&, double);
template json percentiles(const SignedHistogram&, double);

json to_json(const Counts& counts, std::string_view prefix) {
    json out = json::object();
    for (const auto& [name, count] : counts) {
        std::string key = std::string(prefix) + std::string(name);
        std::ranges::replace(key, ' ', '_');
        out[key] = count;
    }
    return out;
}

std::string latency_text(const Histogram& h) {
    return fmt::format("{:.2f} / {:.2f} / {:.2f} ms", h.percentile_ns(0.5) * 1e-6, h.percentile_ns(0.99) * 1e-6,
                       h.max_ns() * 1e-6);
}

std::string non_zero(const Counts& counts) {
    std::string text;
    for (const auto& [name, n] : counts)
        if (n > 0) text += fmt::format("{}{} {}", text.empty() ? "" : ", ", n, name);
    return text.empty() ? "none" : text;
}

std::string dropped_text(const Counts& causes) {
    std::uint64_t all = 0;
    for (const auto& [name, n] : causes) all += n;
    return fmt::format("{} dropped{}", all, all > 0 ? " (" + non_zero(causes) + ")" : "");
}

std::vector<LatenessBin> lateness_bins(const SignedHistogram& late) {
    constexpr std::array kBounds{-30.0, -10.0, -3.0, -1.0, -0.3, 0.0, 0.3, 1.0, 3.0, 10.0, 30.0};
    std::vector<LatenessBin> bins;
    double from = -kInfinity;
    std::uint64_t before = 0;
    for (const double to : kBounds) {
        const std::uint64_t up_to = late.count_up_to(std::llround(to * 1e6));
        bins.push_back({std::exchange(from, to), to, up_to - std::exchange(before, up_to)});
    }
    bins.push_back({from, kInfinity, late.count() - before});
    return bins;
}

std::string against_deadline(double late_ms) {
    return fmt::format("{:.2f} ms {}", std::abs(late_ms), late_ms > 0 ? "after" : "before");
}

std::string lateness_text(const SignedHistogram& late) {
    std::string text;
    for (const auto& [from, to, frames] : lateness_bins(late)) {
        if (frames == 0) continue;
        const bool early = to <= 0;
        const double near = std::abs(early ? to : from), far = std::abs(early ? from : to);
        text += fmt::format("{}{} ", text.empty() ? "" : ", ", frames);
        text += std::isinf(far) ? fmt::format("over {:g} ms", near) : fmt::format("{:g} to {:g} ms", near, far);
        text += early ? " early" : " late";
    }
    return text.empty() ? "none" : text;
}

json lateness(const SignedHistogram& late) {
    json out = percentiles(late, 1e-6), bins = json::array();
    for (const LatenessBin& bin : lateness_bins(late))
        bins.push_back(
            {{"up_to_ms", std::isfinite(bin.to_ms) ? json(bin.to_ms) : json(nullptr)}, {"frames", bin.frames}});
    out["bins"] = std::move(bins);
    return out;
}

}  // namespace narpa
