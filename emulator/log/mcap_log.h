/// emulator/log/mcap_log.h - a run as one MCAP file that Foxglove and others open: `--mcap FILE` of run, rehearse
/// and replay. docs/logs.md lists its channels.
///
/// Log times are of validity, publish times of the hand-over, both of the simulation clock.
#pragma once

#include <atomic>
#include <cstdint>
#include <cstdio>
#include <memory>
#include <mutex>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "base/result.h"
#include "drivers/write_queue.h"
#include "emulator/lidar/lidar_unit.h"
#include "emulator/log/mcap_messages.h"
#include "protocols/foxglove/descriptors.h"
#include "protocols/ledger.h"
#include "protocols/mcap/mcap_writer.h"
#include "renderer/geometry/body_poses.h"

namespace narpa {

class McapLog;

/// What one thread gives to the file. In lockstep it is written at once. In real time it is copied into a queue: a
/// thread of its own encodes and writes; what finds the queue full is dropped as a whole and counted. Giving never
/// allocates or waits in real time.
class McapSource final : public QueueWriter {
public:
    /// `slot_bytes`: the most that it gives at once, beside the bodies' poses.
    McapSource(McapLog& log, std::size_t slot_bytes, bool lockstep);
    ~McapSource() override;

    /// A frame of a camera, as handed over, with the bodies at mid-exposure.
    void frame(const FrameLedger& ledger, std::span<const std::uint8_t> bytes, const BodyPoses& at) noexcept;
    /// The packet that a LiDAR of the scene has just fired.
    void packet(const World& world, std::size_t lidar, const LidarUnit& unit, std::int64_t packet,
                std::int64_t t_sent_ns) noexcept;
    /// An encoded message.
    void message(std::uint16_t channel, std::int64_t t_ns, std::int64_t t_publish_ns,
                 std::span<const std::uint8_t> encoded) noexcept;
    /// Frames, packets and messages so far. After `end`: all.
    [[nodiscard]] std::uint64_t dropped() const noexcept;
    /// Waits until the queue is written, at most a second.
    void end() noexcept;

private:
    friend class McapLog;
    enum class Kind : std::uint8_t { frame, packet, message };
    struct Head {  ///< before the poses of all bodies and the bytes
        Kind kind = Kind::message;
        bool begins_sweep = false;
        std::uint16_t index = 0;  ///< of the LiDAR or the channel
        std::int64_t t_ns = 0;    ///< of the packet's start, or of validity
        std::int64_t t_first_ns = 0, t_publish_ns = 0, packet = 0;
        FrameLedger ledger{};
    };
    void give(const Head& head, std::span<const Rigid3> bodies, std::span<const std::uint8_t> bytes) noexcept;
    void write(std::span<const std::uint8_t> item, const WriteQueue&) noexcept override;
    void abandon(std::span<const std::uint8_t>) noexcept override { ++abandoned_; }

    McapLog& log_;
    std::vector<std::uint8_t> head_;
    BodyPoses at_;
    std::int64_t sweep_ = -1;
    std::atomic<std::uint64_t> abandoned_{0}, dropped_{0};
    std::unique_ptr<WriteQueue> queue_;  ///< null in lockstep and after `end`
};

class McapLog {
public:
    /// Creates the file, with the channels of these cameras and LiDARs (indices in the scene).
    static Result<std::unique_ptr<McapLog>> create(const std::string& path, const Scene& scene,
                                                   std::span<const std::size_t> cameras,
                                                   std::span<const std::size_t> lidars, bool lockstep);
    ~McapLog();

    /// For one thread, before the run. They live as long as the log.
    McapSource& source_of_camera(std::size_t camera);
    McapSource& source_of_lidar(std::size_t lidar);
    McapSource& source(std::size_t slot_bytes);
    /// A further channel, before the run.
    template <ProtoMessage Message>
    [[nodiscard]] std::uint16_t add_channel(const std::string& topic) {
        return channel(topic, ProtoSchema<Message>::kName, &proto_descriptors<Message>);
    }

    /// Writes the rest and closes the file; an Error if it could not be written.
    Status close();

    [[nodiscard]] const std::string& path() const noexcept { return path_; }
    [[nodiscard]] std::uint64_t dropped() const noexcept;
    /// Its part of the report, as JSON and as a line of text. After `close`.
    [[nodiscard]] nlohmann::json report() const;
    [[nodiscard]] std::string to_text() const;

private:
    friend class McapSource;
    struct CameraChannels {
        Camera camera;
        std::uint16_t image = 0, calibration = 0, ledger = 0;
        std::int64_t next_frame = -1;  ///< number that is expected; -1: any
        bool stale = false;
    };
    struct LidarChannel {
        std::string name;
        SweepPoints points;
        std::uint16_t cloud = 0;
        bool open = false;  ///< a sweep has begun
        std::int64_t next_packet = -1, t_sent_ns = 0;
    };
    McapLog(std::string path, std::FILE* file, const Scene& scene, bool lockstep);
    std::uint16_t channel(const std::string& topic, std::string_view schema,
                          std::vector<std::uint8_t> (*descriptors)());
    void take(std::span<const std::uint8_t> item) noexcept;
    void take_frame(const FrameLedger& ledger, std::span<const Rigid3> bodies, std::span<const std::uint8_t> bytes);
    void take_packet(const McapSource::Head& head, std::span<const Rigid3> bodies,
                     std::span<const std::uint8_t> bytes);
    void end_sweep(LidarChannel& lidar);
    void note(std::int64_t t_ns, std::int64_t t_publish_ns, const std::string& name, std::string text);
    template <ProtoMessage Message>
    void put(std::uint16_t channel, std::int64_t t_ns, std::int64_t t_publish_ns, const Message& message);

    std::string path_;
    std::FILE* file_;
    int reason_ = 0;  ///< errno of the first write that failed
    bool lockstep_;
    std::mutex writing_;  ///< of the queues' threads; in real time no sensor takes it
    std::size_t bodies_;
    SceneTransforms transforms_;
    std::unique_ptr<McapWriter> writer_;
    std::vector<std::pair<std::string, std::uint16_t>> schemas_;
    std::uint16_t tf_ = 0, log_ = 0;
    std::vector<std::unique_ptr<CameraChannels>> cameras_;  ///< by index in the scene; null: not in the file
    std::vector<std::unique_ptr<LidarChannel>> lidars_;
    std::vector<Rigid3> placed_;
    std::int64_t t_newest_ns_ = 0;  ///< of what was taken
    std::vector<std::uint8_t> encoded_;
    std::vector<std::unique_ptr<McapSource>> sources_;
    Status closed_{Ok{}};
};

}  // namespace narpa
