/// emulator/pose_track.h - the pose of one commanded body at any time, from its pose commands.
///
/// Between two commands: cubic Hermite in position through the commanded velocities (straight when both commands
/// carry none), slerp in attitude: by the shortest arc, or with the whole turns that the commanded rates state
/// where these are of more than half a turn between the commands. After the newest: constant velocity and body rate
/// for `stale_after_s`; then the body holds still and is reported as stale. One thread writes, any number read;
/// neither side locks or allocates.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>

#include "base/pose.h"
#include "protocols/can/messages.h"

namespace narpa {

struct TrackedPose {
    Motion motion{};             ///< velocity and rate are the derivatives of this pose
    std::uint8_t counter = 0;    ///< of the newest command at or before the requested time
    std::int64_t t_pose_ns = 0;  ///< its time of validity
    bool commanded = false;      ///< false: no command yet, the scene's own motion
    bool stale = true;
};

enum class TrackStatus : std::uint8_t {
    taken,
    past,     ///< time of validity not after the newest: late, repeated or out of order
    overrun,  ///< it would overwrite a command that is ahead or of the last second
};

class PoseTrack {
public:
    /// `initial` is the scene's own motion, used until the first command.
    PoseTrack(const Motion& initial, double stale_after_s);

    /// `t_now_ns`: commands older than a second before this may be overwritten.
    TrackStatus push(const PoseCommand& command, std::int64_t t_now_ns) noexcept;
    [[nodiscard]] TrackedPose at(std::int64_t t_ns) const noexcept;
    /// Forgets all commands. While no other thread uses the track.
    void restart(const Motion& initial) noexcept;

    /// Times of validity of the first and newest command; meaningful when `commanded`.
    [[nodiscard]] bool commanded() const noexcept { return count_.load(std::memory_order_acquire) > 0; }
    [[nodiscard]] std::int64_t first_ns() const noexcept { return first_ns_.load(std::memory_order_acquire); }
    [[nodiscard]] std::int64_t newest_ns() const noexcept { return newest_ns_.load(std::memory_order_acquire); }

    /// Size of the ring; kDepth - 1 commands are kept: at 1000 a second, those of the last second and of one second
    /// ahead.
    static constexpr std::size_t kDepth = 2048;

private:
    struct Sample {
        std::int64_t t_ns = 0;
        std::uint64_t counter = 0;
        Motion motion{};
    };
    /// A seqlock, rewritten only after kDepth - 1 others; a reader that meets a write repeats. Word 0 is the time.
    struct Slot {
        std::atomic<std::uint64_t> version{0};  ///< odd during a write
        std::array<std::atomic<std::uint64_t>, sizeof(Sample) / 8> words{};
        void store(const Sample&) noexcept;
        [[nodiscard]] bool load(Sample&) const noexcept;
        [[nodiscard]] std::int64_t t_ns() const noexcept {
            return static_cast<std::int64_t>(words[0].load(std::memory_order_acquire));
        }
    };
    static_assert(sizeof(Sample) % 8 == 0);

    enum class Found : std::uint8_t { between, after_newest, before_oldest, nothing, torn };
    [[nodiscard]] const Slot& slot(std::uint64_t index) const noexcept { return slots_[index % kDepth]; }
    [[nodiscard]] Found bracket(std::int64_t t_ns, Sample& before, Sample& after) const noexcept;
    [[nodiscard]] Motion interpolate(const Sample& a, const Sample& b, std::int64_t t_ns) const noexcept;

    Motion initial_;
    std::int64_t stale_after_ns_;
    std::array<Slot, kDepth> slots_{};
    std::atomic<std::uint64_t> count_{0};
    std::atomic<std::int64_t> first_ns_{0}, newest_ns_{0};
};

}  // namespace narpa
