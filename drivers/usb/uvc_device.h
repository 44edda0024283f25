/// drivers/usb/uvc_device.h - a USB camera in software: a UVC device whose frames come from one thread and go to a
/// host on the server's. A frame waits for its host: none is lost once the stream runs, and none is shown twice.
#pragma once

#include <condition_variable>
#include <cstdint>
#include <functional>
#include <mutex>
#include <optional>
#include <span>
#include <string>

#include "base/spsc_ring.h"
#include "drivers/usb/usb_device.h"
#include "drivers/video/video_sink.h"
#include "protocols/usb/uvc.h"

namespace narpa {

class UvcDevice final : public UsbDevice {
public:
    static constexpr std::uint16_t kVendor = 0x1209, kProduct = 0x0001;  ///< pid.codes: for tests

    /// `format`: one that uvc_carries.
    UvcDevice(const VideoFormat& format, const std::optional<VideoControls>& controls, std::string serial);

    // --- From the server's thread ---
    [[nodiscard]] const UsbDescriptors& descriptors() const noexcept override { return descriptors_; }
    void plugged(bool in) noexcept override;
    [[nodiscard]] int control(const UsbSetup& setup, std::span<std::uint8_t> data) noexcept override;
    [[nodiscard]] int take(int endpoint, std::span<const std::uint8_t> data) noexcept override;
    [[nodiscard]] int give(int endpoint, std::span<std::uint8_t> room) noexcept override;

    // --- From the thread that has the frames ---
    enum class Shown : std::uint8_t {
        whole,      ///< the host has all of it
        no_stream,  ///< no host wants frames
        broken,     ///< the stream ended, or time ran out, before the host had all of it
    };
    /// Waits until the host has the frame. `wake`: UsbIpServer::wake. `gives_up` is called every 20 ms; true ends
    /// the wait.
    Shown show(std::span<const std::uint8_t> frame, std::int64_t t_ns, const std::function<void()>& wake,
               const std::function<bool()>& gives_up);
    /// Times that a host has started the stream.
    [[nodiscard]] std::uint64_t streams() const noexcept { return streams_.load(std::memory_order_relaxed); }

    /// The next setting from the host, in order; called from one thread. False: nothing more.
    bool next_request(VideoRequest& request) noexcept { return requests_.pop(request); }

private:
    void set_streaming(bool on) noexcept;
    int stream_control(const UsbSetup& setup, std::span<std::uint8_t> data) noexcept;
    int camera_control(const UsbSetup& setup, std::span<std::uint8_t> data) noexcept;
    int refuse(std::uint8_t code) noexcept;

    VideoFormat format_;
    std::optional<VideoControls> controls_;
    VideoControls at_start_;
    UsbDescriptors descriptors_;
    std::uint8_t error_code_ = 0;  // of the last control request
    SpscRing<VideoRequest, 64> requests_;
    std::atomic<std::uint64_t> streams_{0};

    std::mutex mutex_;
    std::condition_variable changed_;
    bool streaming_ = false, frame_id_ = false;
    std::span<const std::uint8_t> frame_;  // the rest of the frame that the host has not read
    std::int64_t t_frame_ns_ = 0;
};

}  // namespace narpa
