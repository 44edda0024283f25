#include "emulator/pose_track.h"

#include <cassert>
#include <cmath>
#include <cstring>

#include "base/motion_between.h"
#include "base/time.h"

namespace narpa {
namespace {

constexpr double kSecondsPerNs = 1e-9;
constexpr std::int64_t kHistory_ns = kSecond_ns;  // sensors look back by an exposure or a packet, never more

}  // namespace

PoseTrack::PoseTrack(const Motion& initial, double stale_after_s)
    : initial_(initial), stale_after_ns_(std::llround(stale_after_s * 1e9)) {}

void PoseTrack::restart(const Motion& initial) noexcept {
    initial_ = initial;
    count_ = 0;
    first_ns_ = newest_ns_ = 0;
}

void PoseTrack::Slot::store(const Sample& s) noexcept {
    std::array<std::uint64_t, sizeof(Sample) / 8> raw;
    std::memcpy(raw.data(), &s, sizeof s);
    version.fetch_add(1, std::memory_order_acq_rel);
    for (std::size_t i = 0; i < raw.size(); ++i) words[i].store(raw[i], std::memory_order_release);
    version.fetch_add(1, std::memory_order_release);
}

bool PoseTrack::Slot::load(Sample& s) const noexcept {
    std::array<std::uint64_t, sizeof(Sample) / 8> raw;
    const std::uint64_t before = version.load(std::memory_order_acquire);
    for (std::size_t i = 0; i < raw.size(); ++i) raw[i] = words[i].load(std::memory_order_acquire);
    if ((before & 1) != 0 || version.load(std::memory_order_acquire) != before) return false;
    std::memcpy(static_cast<void*>(&s), raw.data(), sizeof s);
    return true;
}

TrackStatus PoseTrack::push(const PoseCommand& command, std::int64_t t_now_ns) noexcept {
    const std::uint64_t count = count_.load(std::memory_order_relaxed);
    if (count > 0 && command.t_valid_ns <= newest_ns_.load(std::memory_order_relaxed)) return TrackStatus::past;
    Slot& slot = slots_[count % kDepth];
    if (count >= kDepth - 1) {  // the oldest that must stay is the one after the slot that is given up
        Sample next_oldest;
        if (slots_[(count + 1) % kDepth].load(next_oldest) && next_oldest.t_ns > t_now_ns - kHistory_ns)
            return TrackStatus::overrun;
    }
    slot.store({command.t_valid_ns, command.counter, command.motion});
    if (count == 0) first_ns_.store(command.t_valid_ns, std::memory_order_release);
    newest_ns_.store(command.t_valid_ns, std::memory_order_release);
    count_.store(count + 1, std::memory_order_release);
    return TrackStatus::taken;
}

/// `before`: the newest sample at or before t. `after`: the one that follows it, or the oldest of all.
PoseTrack::Found PoseTrack::bracket(std::int64_t t_ns, Sample& before, Sample& after) const noexcept {
    const std::uint64_t count = count_.load(std::memory_order_acquire);
    if (count == 0) return Found::nothing;
    if (!slot(count - 1).load(before)) return Found::torn;
    if (before.t_ns <= t_ns) return Found::after_newest;
    // Invariant: the sample at `high` is after t; those before `low` are not.
    std::uint64_t low = count - std::min<std::uint64_t>(count, kDepth - 1), high = count - 1;
    const std::uint64_t oldest = low;
    while (low < high) {
        const std::uint64_t middle = low + (high - low) / 2;
        slot(middle).t_ns() > t_ns ? high = middle : low = middle + 1;
    }
    // `after` first: while the slot of `before` has not been rewritten, the one that follows has not been either.
    if (!slot(high).load(after) || after.t_ns <= t_ns) return Found::torn;
    if (high == oldest) return Found::before_oldest;
    if (!slot(high - 1).load(before) || before.t_ns > t_ns) return Found::torn;
    return Found::between;
}

Motion PoseTrack::interpolate(const Sample& a, const Sample& b, std::int64_t t_ns) const noexcept {
    assert(a.t_ns < b.t_ns && a.t_ns <= t_ns && t_ns <= b.t_ns);
    const double h = static_cast<double>(b.t_ns - a.t_ns) * kSecondsPerNs;
    const double u = static_cast<double>(t_ns - a.t_ns) / static_cast<double>(b.t_ns - a.t_ns);
    return motion_between(a.motion, b.motion, h, u);
}

TrackedPose PoseTrack::at(std::int64_t t_ns) const noexcept {
    Sample a, b;
    Found found = bracket(t_ns, a, b);
    while (found == Found::torn) found = bracket(t_ns, a, b);

    // After the newest command, or before the oldest one kept: extrapolates its motion up to the limit, then holds
    // still.
    const auto run_on = [&](const Sample& s) {
        const std::int64_t asked = t_ns - s.t_ns, dt = std::clamp(asked, -stale_after_ns_, stale_after_ns_);
        Motion m = extrapolate(s.motion, static_cast<double>(dt) * kSecondsPerNs);
        if (dt != asked) m.velocity_m_s = m.rate_rad_s = {};
        return TrackedPose{m, static_cast<std::uint8_t>(s.counter), s.t_ns, true, dt != asked};
    };
    switch (found) {
        case Found::between:
            return {t_ns == a.t_ns ? a.motion : interpolate(a, b, t_ns), static_cast<std::uint8_t>(a.counter),
                    a.t_ns, true, false};
        case Found::after_newest: return run_on(a);
        case Found::before_oldest: return run_on(b);
        default: return {extrapolate(initial_, static_cast<double>(t_ns) * kSecondsPerNs), 0, 0, false, true};
    }
}

}  // namespace narpa
