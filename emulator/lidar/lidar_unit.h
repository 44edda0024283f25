/// emulator/lidar/lidar_unit.h - one LiDAR under emulation: packet number -> the bytes that the instrument would
/// send.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "emulator/world.h"
#include "protocols/lidar/lidar_model.h"
#include "renderer/lidar/lidar_receiver.h"

namespace narpa {

class LidarUnit {
public:
    /// `world` must outlive the unit. `truth`: also computes the truth of each shot, at the cost of a second ray
    /// where the beam has sub-rays. Allocates here and never again.
    LidarUnit(const World& world, std::size_t index, bool truth = false);

    [[nodiscard]] const Lidar& lidar() const noexcept { return lidar_; }
    [[nodiscard]] const LidarSpec& spec() const noexcept { return model_.spec(); }
    [[nodiscard]] std::int64_t packet_start_ns(std::int64_t packet) const noexcept {
        return model_.packet_start_ns(packet);
    }
    [[nodiscard]] std::int64_t packet_period_ns() const noexcept { return spec().packet_period_ns; }
    /// The first packet that starts at t_ns >= 0 or later.
    [[nodiscard]] std::int64_t first_packet_from(std::int64_t t_ns) const noexcept {
        return model_.first_packet_from(t_ns);
    }
    [[nodiscard]] std::int64_t sweep(std::int64_t packet) const noexcept { return model_.sweep(packet); }
    /// A packet is sent when it is complete.
    [[nodiscard]] std::int64_t t_sent_ns(std::int64_t packet) const noexcept {
        return packet_start_ns(packet) +
               (spec().packet_complete_ns > 0 ? spec().packet_complete_ns : packet_period_ns());
    }

    /// Fires a packet's shots, every body where it is at each shot's own time. `epoch`: UTC of simulation time 0.
    void fire(std::int64_t packet, LidarUtc epoch) noexcept;
    /// With the scene's epoch.
    void fire(std::int64_t packet) noexcept { fire(packet, world_.scene().epoch_unix_ns); }
    /// The packet just fired, as it is sent. Empty where all shots fall outside of the unit's window.
    [[nodiscard]] std::span<const std::uint8_t> bytes() const noexcept {
        return fires_ ? std::span<const std::uint8_t>(bytes_) : std::span<const std::uint8_t>();
    }
    [[nodiscard]] std::size_t returns() const noexcept { return returns_; }
    /// The shots of the packet, and what the unit reports of each, before rounding.
    [[nodiscard]] std::span<const LidarShot> shots() const noexcept { return shots_; }
    [[nodiscard]] std::span<const LidarEchoes> echoes() const noexcept { return echoes_; }
    /// What the axis of each shot meets: exact ranges, bodies, velocities. Empty without `truth`.
    [[nodiscard]] std::span<const LidarReturn> truth() const noexcept { return truth_; }

    /// The position packet that follows this data packet; empty where none does.
    [[nodiscard]] std::span<const std::uint8_t> position(std::int64_t packet, LidarUtc epoch) noexcept;
    [[nodiscard]] std::span<const std::uint8_t> position(std::int64_t packet) noexcept {
        return position(packet, world_.scene().epoch_unix_ns);
    }

private:
    /// Shots of a packet for which bodies are placed together, and when the first and the last is fired.
    struct Span {
        std::size_t first, n;
        std::int64_t begin_ns, end_ns;
    };
    /// Calls `work(Span)` for the packet's shots; longer spans have no velocities.
    template <class Work>
    void over_spans(std::int64_t start_ns, std::int64_t span_ns, const Work& work) noexcept;
    /// Appends a shot in the LiDAR's axes, with its time in nanoseconds after the span's begin.
    void put_beam(std::size_t shot, std::int64_t start_ns, const Span& span, RayBatch& beams) noexcept;
    /// Transforms these beams to world axes, and their times to fractions of the span.
    void place(const Span& span, RayBatch& beams) noexcept;
    void trace_echoes(std::int64_t packet, std::int64_t start_ns) noexcept;
    void trace_truth(std::int64_t start_ns) noexcept;

    const World& world_;
    Lidar lidar_;
    const LidarModel& model_;
    LidarReceiver receiver_;
    BodyPoses placement_;
    std::vector<Motion> motions_;  ///< empty where neither velocities nor the truth are needed
    std::size_t returns_ = 0;
    bool fires_ = true;
    std::vector<LidarShot> shots_;
    std::vector<LidarEchoes> echoes_;
    std::vector<LidarReturn> truth_;
    std::vector<std::uint8_t> bytes_, position_;
    std::vector<std::uint32_t> by_laser_;  ///< shots of a packet that is one span; else empty
};

}  // namespace narpa
