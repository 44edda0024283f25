#include "renderer/film/pass_costs.h"

#include <algorithm>

namespace narpa {
namespace {

/// Doubt lowers an estimate by this factor, to no less than that part of the last measurement.
constexpr double kDoubt = 0.95, kLeastBelieved = 0.25;
/// The time of passes of fewer samples is mostly that of their start and end: it is an upper bound only.
constexpr std::uint64_t kLeastPieces = 1000;

}  // namespace

void PassCosts::note(Of what, std::uint64_t pieces, std::int64_t wall_ns) noexcept {
    if (pieces == 0) return;
    double& ns = ns_[index(what)];
    const double now = static_cast<double>(wall_ns) / static_cast<double>(pieces);
    if (pieces < kLeastPieces && !(known(what) && now < ns)) return;
    // A frame that something delayed predicts little of the next.
    switch (measurements_[index(what)]) {
        case 0: ns = now; break;
        case 1: ns = std::min(ns, now); break;
        default: ns += 0.3 * (std::clamp(now, 0.5 * ns, 2 * ns) - ns);
    }
    if (measurements_[index(what)] < 2) ++measurements_[index(what)];
    least_ns_[index(what)] = kLeastBelieved * ns;
}

void PassCosts::doubt(Of what) noexcept {
    ns_[index(what)] = std::max(kDoubt * ns_[index(what)], least_ns_[index(what)]);
}

std::uint64_t PassCosts::fitting(Of what, std::int64_t wall_ns) const noexcept {
    return static_cast<std::uint64_t>(static_cast<double>(std::max<std::int64_t>(wall_ns, 0)) / ns_[index(what)]);
}

}  // namespace narpa
