/// drivers/usb/bridge_device.h - a frame bridge in software, in place of an FPGA or an FX3 behind a bulk endpoint:
/// receives the frames of `--video CAMERA=bulk:`. Wire: protocols/video/bulk_frame.h.
#pragma once

#include <array>
#include <condition_variable>
#include <cstdint>
#include <functional>
#include <mutex>
#include <span>
#include <string>
#include <vector>

#include "drivers/usb/usb_device.h"
#include "drivers/video/video_source.h"
#include "protocols/video/bulk_frame.h"

namespace narpa {

class BridgeDevice final : public UsbDevice {
public:
    static constexpr std::uint16_t kVendor = 0x1209, kProduct = 0x0002;  ///< pid.codes: for tests
    static constexpr int kOut = 1;                                       ///< endpoint
    static constexpr std::size_t kPacketBytes = 512, kFrames = 4;        ///< frames that wait for the reader

    /// Frames of another format are counted as truncated.
    BridgeDevice(const VideoFormat& format, std::string serial);

    // --- From the server's thread ---
    [[nodiscard]] const UsbDescriptors& descriptors() const noexcept override { return descriptors_; }
    void plugged(bool in) noexcept override;
    [[nodiscard]] int control(const UsbSetup& setup, std::span<std::uint8_t> data) noexcept override;
    [[nodiscard]] int take(int endpoint, std::span<const std::uint8_t> data) noexcept override;
    [[nodiscard]] int give(int endpoint, std::span<std::uint8_t> room) noexcept override;

    // --- From the thread that reads the frames ---
    /// The next whole frame, in order; waits at most `timeout_ns`. `pixels`: link_bytes of the format. `wake`:
    /// UsbIpServer::wake. False: none came.
    bool receive(std::span<std::uint8_t> pixels, BulkFrameHeader& header, std::int64_t timeout_ns,
                 const std::function<void()>& wake);
    /// `lost`: gaps in the frames' numbers.
    [[nodiscard]] VideoSourceCounters counters() const;

private:
    struct Slot {
        BulkFrameHeader header;
        std::vector<std::uint8_t> bytes;  ///< header and pixels
    };

    void conclude() noexcept;
    void drop_partial() noexcept;

    VideoFormat format_;
    UsbDescriptors descriptors_;
    mutable std::mutex mutex_;
    std::condition_variable arrived_;
    std::array<Slot, kFrames> slots_;
    std::size_t first_ = 0, ready_ = 0;  ///< slots with whole frames; the one behind them is being filled
    std::size_t filled_ = 0;             ///< bytes received for it, also those beyond its end
    bool has_number_ = false;
    std::uint32_t number_ = 0;
    VideoSourceCounters counters_;
};

}  // namespace narpa
