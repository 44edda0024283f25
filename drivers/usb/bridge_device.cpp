#include "drivers/usb/bridge_device.h"

#include <algorithm>
#include <chrono>
#include <utility>

#include "protocols/crc32.h"

namespace narpa {
namespace {

UsbDescriptors bridge_descriptors(std::string serial) {
    UsbDescriptors d;
    d.speed = UsbSpeed::high;
    d.device.vendor = BridgeDevice::kVendor, d.device.product = BridgeDevice::kProduct;
    d.device.maker_string = 1, d.device.product_string = 2, d.device.serial_string = 3;
    d.strings = {"narpa", "narpa frame bridge", std::move(serial)};
    constexpr std::uint8_t kBulk = 2;
    d.configuration = UsbConfigurationWriter(1, 100)
                          .interface({0, 0, 0xff, 0, 0}, 1)
                          .endpoint({BridgeDevice::kOut, kBulk, BridgeDevice::kPacketBytes})
                          .bytes();
    return d;
}

}  // namespace

BridgeDevice::BridgeDevice(const VideoFormat& format, std::string serial)
    : format_(format), descriptors_(bridge_descriptors(std::move(serial))) {
    for (Slot& slot : slots_) slot.bytes.resize(kBulkHeaderBytes + link_bytes(format));
}

// --- The server's thread ---------------------------------------------

void BridgeDevice::plugged(bool /*in*/) noexcept {
    const std::lock_guard lock(mutex_);
    drop_partial();
}

int BridgeDevice::control(const UsbSetup& setup, std::span<std::uint8_t> /*data*/) noexcept {
    if (setup.kind() != 0) return UsbAnswer::kStall;
    const std::lock_guard lock(mutex_);
    if (setup.request == UsbRequest::kClearFeature) drop_partial();  // the host restarts the stream
    return 0;
}

int BridgeDevice::take(int endpoint, std::span<const std::uint8_t> data) noexcept {
    if (endpoint != kOut) return UsbAnswer::kStall;
    const std::lock_guard lock(mutex_);
    if (ready_ == kFrames) return UsbAnswer::kPending;
    std::vector<std::uint8_t>& bytes = slots_[(first_ + ready_) % kFrames].bytes;
    if (filled_ < bytes.size())
        std::copy_n(data.begin(), std::min(data.size(), bytes.size() - filled_),
                    bytes.begin() + static_cast<std::ptrdiff_t>(filled_));
    filled_ += data.size();
    if (data.empty() || data.size() % kPacketBytes != 0) conclude();
    return static_cast<int>(data.size());
}

int BridgeDevice::give(int /*endpoint*/, std::span<std::uint8_t> /*room*/) noexcept {
    return UsbAnswer::kStall;
}

/// Checks the frame that a short packet has ended, and releases its slot to the reader.
void BridgeDevice::conclude() noexcept {
    Slot& slot = slots_[(first_ + ready_) % kFrames];
    const auto bytes = std::span<const std::uint8_t>(slot.bytes);
    const auto header = decode_bulk_header(bytes.first(kBulkHeaderBytes));
    const bool is_good = filled_ == bytes.size() && header &&
                         is_same_on_link({static_cast<int>(header->width), static_cast<int>(header->height),
                                          header->pixel, format_.period_ns, header->link},
                                         format_) &&
                         header->pixels_crc32 == crc32(bytes.subspan(kBulkHeaderBytes));
    if (!is_good) return drop_partial();
    filled_ = 0;
    slot.header = *header;
    if (has_number_) counters_.lost += header->number - number_ - 1;
    has_number_ = true;
    number_ = header->number;
    ++ready_;
    arrived_.notify_one();
}

void BridgeDevice::drop_partial() noexcept {
    counters_.truncated += filled_ > 0;
    filled_ = 0;
}

// --- The thread that reads the frames --------------------------------

bool BridgeDevice::receive(std::span<std::uint8_t> pixels, BulkFrameHeader& header, std::int64_t timeout_ns,
                           const std::function<void()>& wake) {
    {
        std::unique_lock lock(mutex_);
        if (!arrived_.wait_for(lock, std::chrono::nanoseconds(timeout_ns), [&] { return ready_ > 0; }))
            return false;
        const Slot& slot = slots_[first_];
        header = slot.header;
        std::ranges::copy(std::span(slot.bytes).subspan(kBulkHeaderBytes), pixels.begin());
        first_ = (first_ + 1) % kFrames;
        --ready_;
        ++counters_.received;
    }
    wake();  // there is room again
    return true;
}

VideoSourceCounters BridgeDevice::counters() const {
    const std::lock_guard lock(mutex_);
    return counters_;
}

}  // namespace narpa
