/// drivers/video/video_sink.h - sink of frames: a V4L2 output device, a USB camera or frame bridge, Y4M to a file,
/// a FIFO or TCP clients, UDP datagrams, RTP packets, a GigE Vision camera, or none.
///
/// A sink owns a thread and a ring of preallocated frames, so that handing over a frame is one copy: no disk,
/// reader or device can block the loop.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "base/pixel_format.h"
#include "base/result.h"
#include "drivers/device_kind.h"

namespace narpa {

struct VideoCounters {
    std::uint64_t written = 0;    ///< whole frames that reached the device, file or reader
    std::uint64_t ring_full = 0;  ///< dropped: the sink could not keep up
    std::uint64_t no_reader = 0;  ///< dropped: a FIFO or TCP port without a reader, a UDP port that nobody has
    std::uint64_t failed = 0;  ///< dropped: the write failed (device gone, disk full), or a TCP client was too slow
    std::uint64_t reconnects = 0;  ///< times that a reader or a device was connected again
};

/// Which frame it is. Sinks that have no place for it leave it out.
struct FrameStamp {
    std::int64_t t_ns = 0;     ///< mid-exposure, simulation clock
    std::uint32_t number = 0;  ///< +1 with every frame that falls due
};

/// Limits and start values of the settings that a reader may change, for sinks with controls.
struct VideoControls {
    std::int64_t exposure_min_ns = 0, exposure_max_ns = 0, exposure_ns = 0;
    std::int16_t gain_max_cdb = 0, gain_cdb = 0;  ///< 0.01 dB
    bool auto_exposure = false;
};
/// Settings that the reader has changed, within the limits; absent ones are unchanged.
struct VideoRequest {
    std::optional<std::int64_t> exposure_ns{};
    std::optional<std::int16_t> gain_cdb{};
    std::optional<bool> auto_exposure{};
};

/// When the ring is full, a real-time run drops the frame and a lockstep run waits, so that no frame is lost.
enum class WhenFull : std::uint8_t { drop, wait };

class VideoSink {
public:
    virtual ~VideoSink() = default;  ///< flushes what is in the ring, within a second
    /// Copies one whole frame (frame_bytes) into the ring. False: dropped and counted. Never blocks unless
    /// the sink was opened with WhenFull::wait.
    virtual bool send(std::span<const std::uint8_t> frame, const FrameStamp& stamp) noexcept = 0;
    bool send(std::span<const std::uint8_t> frame) noexcept { return send(frame, {}); }
    /// Waits, at most a second, until what was sent is written; then the counters are final.
    virtual void flush() noexcept = 0;
    [[nodiscard]] virtual VideoCounters counters() const noexcept = 0;
    /// An Error when the sink is a file that did not take every frame; final after a flush.
    [[nodiscard]] virtual Status failure() const { return Ok{}; }
    [[nodiscard]] virtual std::string description() const = 0;
    /// The next request of the reader; false: none. To be called from one thread.
    virtual bool next_request(VideoRequest& /*request*/) noexcept { return false; }
};

/// SINK: a text of one of the kinds in open_video.cpp. `controls`: absent where the camera has none; sinks without
/// controls leave them out.
Result<std::unique_ptr<VideoSink>> open_video_sink(std::string_view spec, const VideoFormat& format, WhenFull full,
                                                   const std::optional<VideoControls>& controls = {});
/// The kind that a text names; null: none.
[[nodiscard]] const DeviceKind* video_sink_kind(const std::string& spec);
/// All kinds, for --help.
/// Whether a file could hold frames of this format and be written; it is left as it is.
[[nodiscard]] Status check_video_file(const std::string& path, const VideoFormat& format);
[[nodiscard]] std::string video_sink_help();

}  // namespace narpa
