/// emulator/log/histogram.h - percentiles of a latency without keeping the samples: 32 buckets an octave (3 %),
/// exact maximum, no allocation. After Gil Tene's HdrHistogram.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>

namespace narpa {

class Histogram {
public:
    void add(std::int64_t ns) noexcept {
        const std::uint64_t v = ns < 0 ? 0 : static_cast<std::uint64_t>(ns);
        ++counts_[bucket(v)];
        ++total_;
        max_ = std::max(max_, v);
    }
    [[nodiscard]] std::uint64_t count() const noexcept { return total_; }
    [[nodiscard]] double max_ns() const noexcept { return static_cast<double>(max_); }

    /// How many samples do not exceed a value, to the bucket.
    [[nodiscard]] std::uint64_t count_up_to(std::int64_t ns) const noexcept {
        std::uint64_t seen = 0;
        for (std::size_t b = 0; b < counts_.size() && upper(b) <= static_cast<std::uint64_t>(ns); ++b)
            seen += counts_[b];
        return seen;
    }
    /// The value that a fraction p of the samples does not exceed; 0 without samples.
    [[nodiscard]] double percentile_ns(double p) const noexcept {
        if (total_ == 0) return 0;
        const double wanted = std::max(1.0, std::ceil(p * static_cast<double>(total_)));
        std::uint64_t seen = 0;
        for (std::size_t b = 0; b < counts_.size(); ++b) {
            seen += counts_[b];
            if (static_cast<double>(seen) >= wanted)
                return std::min(static_cast<double>(upper(b)), static_cast<double>(max_));
        }
        return static_cast<double>(max_);
    }

private:
    static constexpr int kBits = 5;  // 2^5 buckets an octave
    static std::size_t bucket(std::uint64_t v) noexcept {
        if (v < (1U << kBits)) return v;
        const int shift = static_cast<int>(std::bit_width(v)) - 1 - kBits;
        return (static_cast<std::size_t>(shift + 1) << kBits) + ((v >> shift) & ((1U << kBits) - 1));
    }
    /// Largest value of a bucket.
    static std::uint64_t upper(std::size_t b) noexcept {
        if (b < (1U << kBits)) return b;
        const int shift = static_cast<int>(b >> kBits) - 1;
        const std::uint64_t base = (1ULL << kBits) + (b & ((1U << kBits) - 1));
        return ((base + 1) << shift) - 1;
    }

    std::array<std::uint64_t, (64 - kBits + 1) << kBits> counts_{};
    std::uint64_t total_ = 0, max_ = 0;
};

/// The same for signed times, negative before a mark.
class SignedHistogram {
public:
    void add(std::int64_t ns) noexcept { ns < 0 ? before_.add(-ns) : after_.add(ns); }
    [[nodiscard]] std::uint64_t count() const noexcept { return before_.count() + after_.count(); }
    /// How many samples do not exceed a value, to the bucket; the sign is exact.
    [[nodiscard]] std::uint64_t count_up_to(std::int64_t ns) const noexcept {
        return ns < 0 ? before_.count() - before_.count_up_to(-ns - 1) : before_.count() + after_.count_up_to(ns);
    }
    [[nodiscard]] double max_ns() const noexcept {
        return after_.count() > 0 ? after_.max_ns() : -before_.percentile_ns(0);
    }
    [[nodiscard]] double percentile_ns(double p) const noexcept {
        const auto before = static_cast<double>(before_.count());
        const double wanted = std::max(1.0, std::ceil(p * static_cast<double>(count())));
        if (count() == 0) return 0;
        // The wanted-th smallest is the (before - wanted + 1)-th smallest of the times before, without their sign.
        if (wanted <= before) return -before_.percentile_ns((before - wanted + 1) / before);
        return after_.percentile_ns((wanted - before) / static_cast<double>(after_.count()));
    }

private:
    Histogram before_, after_;
};

}  // namespace narpa
