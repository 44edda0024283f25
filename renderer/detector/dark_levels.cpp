#include "renderer/detector/dark_levels.h"

#include <algorithm>
#include <cmath>

namespace narpa {
namespace {

constexpr double kBeyond = 6.5;  // standard deviations: the probability is less than 2^-33
constexpr std::uint64_t kWords = std::uint64_t{1} << 32, kColumnWords = kWords / DarkLevels::kColumns;

/// Standard normal distribution function, to 1e-14, for |x| <= kBeyond: 1/2 + phi(x) (x + x^3 / 3 + x^5 / 15 +
/// ...), G. Marsaglia, "Evaluating the normal distribution", J. Stat. Software 11 (2004). Basic arithmetic only, so
/// that the result is the same on every machine.
double normal_cdf(double x) noexcept {
    const double square = x * x, exponent = -square / 2 / 64;
    double term = x, sum = x;
    for (int k = 3; std::abs(term) > 1e-17 * std::abs(sum); k += 2) sum += term *= square / k;
    double density = 1;
    for (int n = 12; n > 0; --n) density = 1 + density * exponent / n;
    for (int n = 0; n < 6; ++n) density *= density;
    return 0.5 + 0.398942280401432678 * density * sum;
}

/// Number of random words that stand for values below x standard deviations.
std::uint64_t words_below(double x) noexcept {
    if (x >= kBeyond) return kWords;
    if (x <= -kBeyond) return 0;
    return static_cast<std::uint64_t>(normal_cdf(x) * static_cast<double>(kWords) + 0.5);
}

}  // namespace

DarkLevels::DarkLevels(double black_dn, double read_noise_dn, std::int32_t top_dn) noexcept {
    const double reach_dn = kBeyond * read_noise_dn;
    if (!(read_noise_dn > 0) || !(reach_dn < kColumns)) return;
    const auto within = [&](double dn) {
        return static_cast<std::int32_t>(std::clamp(dn, 0.0, static_cast<double>(top_dn)));
    };
    const std::int32_t least = within(black_dn - reach_dn), most = within(black_dn + reach_dn + 1);
    if (most - least >= static_cast<std::int32_t>(kColumns)) return;

    std::array<std::uint64_t, kColumns> words{};  // probability of each value, in words
    std::uint64_t below = 0;
    for (std::int32_t dn = least; dn <= most; ++dn) {
        const std::uint64_t up_to = dn == most ? kWords : words_below((dn + 0.5 - black_dn) / read_noise_dn);
        words[static_cast<std::size_t>(dn - least)] = up_to - below;
        below = up_to;
    }

    // A value with less than one column's probability shares its column with a value that has more.
    std::array<std::uint8_t, kColumns> few, many;
    std::size_t n_few = 0, n_many = 0;
    for (std::size_t v = 0; v < kColumns; ++v) {
        const auto value = static_cast<std::uint8_t>(v);
        if (words[v] < kColumnWords)
            few[n_few++] = value;
        else
            many[n_many++] = value;
        columns_[v] = value;
    }
    while (n_few > 0) {
        const std::size_t v = few[--n_few], other = many[n_many - 1];
        columns_[v] = static_cast<std::uint32_t>(words[v] << 8 | other);
        words[other] -= kColumnWords - words[v];
        if (words[other] < kColumnWords) few[n_few++] = many[--n_many];
    }
    min_dn_ = static_cast<std::uint32_t>(least);
    any_ = true;
}

}  // namespace narpa
