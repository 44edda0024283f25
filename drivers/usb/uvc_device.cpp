#include "drivers/usb/uvc_device.h"

#include <algorithm>
#include <chrono>
#include <utility>

#include "base/time.h"
#include "protocols/little_endian.h"

namespace narpa {
namespace {

constexpr std::uint8_t kOutOfRange = 4, kNoSuchUnit = 5, kNoSuchControl = 6, kNoSuchRequest = 7;
constexpr std::uint8_t kManual = 1, kAutomatic = 2;  // exposure modes
constexpr std::uint8_t kCanGetAndSet = 3;

UsbDescriptors camera_descriptors(const VideoFormat& format, bool with_controls, std::string serial) {
    UsbDescriptors d;
    d.speed = UsbSpeed::high;
    d.device.device_class = 0xef, d.device.subclass = 2, d.device.protocol = 1;  // interface association
    d.device.vendor = UvcDevice::kVendor, d.device.product = UvcDevice::kProduct;
    d.device.maker_string = 1, d.device.product_string = 2, d.device.serial_string = 3;
    d.strings = {"narpa", "narpa camera", std::move(serial)};
    d.configuration = uvc_configuration(format, with_controls);
    return d;
}

int reply(std::span<std::uint8_t> room, std::uint32_t value, std::size_t bytes) noexcept {
    std::array<std::uint8_t, 4> b{};
    put_le(b.data(), value);
    const std::size_t n = std::min(bytes, room.size());
    std::copy_n(b.begin(), n, room.begin());
    return static_cast<int>(n);
}

/// An exposure in units of kUvcExposureUnit_ns, rounded down, at least 1.
std::uint32_t exposure_units(std::int64_t ns) noexcept {
    return static_cast<std::uint32_t>(std::max<std::int64_t>(1, ns / kUvcExposureUnit_ns));
}

}  // namespace

UvcDevice::UvcDevice(const VideoFormat& format, const std::optional<VideoControls>& controls, std::string serial)
    : format_(format),
      controls_(controls),
      at_start_(controls.value_or(VideoControls{})),
      descriptors_(camera_descriptors(format, controls.has_value(), std::move(serial))) {}

// --- The server's thread ---------------------------------------------

void UvcDevice::plugged(bool /*in*/) noexcept {
    set_streaming(false);
}

void UvcDevice::set_streaming(bool on) noexcept {
    const std::lock_guard lock(mutex_);
    if (on && !streaming_) {
        streams_.fetch_add(1, std::memory_order_relaxed);
        frame_id_ = false;
    }
    streaming_ = on;
    frame_ = {};  // a frame is shown whole or not at all
    changed_.notify_all();
}

int UvcDevice::control(const UsbSetup& setup, std::span<std::uint8_t> data) noexcept {
    if (setup.kind() == 0) {
        // Linux ends a bulk stream by clearing its endpoint.
        if (setup.request == UsbRequest::kClearFeature && (setup.index & 0x8f) == (0x80 | UvcIds::kStream))
            set_streaming(false);
        return 0;
    }
    if (setup.kind() != 1 || setup.recipient() != 1) return UsbAnswer::kStall;
    switch (setup.index & 0xff) {
        case UvcIds::kStreamInterface: return stream_control(setup, data);
        case UvcIds::kControlInterface: return camera_control(setup, data);
        default: return UsbAnswer::kStall;
    }
}

int UvcDevice::stream_control(const UsbSetup& setup, std::span<std::uint8_t> data) noexcept {
    const int selector = setup.value >> 8;
    if (selector != UvcControl::kProbe && selector != UvcControl::kCommit) return UsbAnswer::kStall;
    switch (setup.request) {
        case UvcRequest::kSetCurrent: {
            const auto wanted = decode_uvc_probe(data);
            if (!wanted) return UsbAnswer::kStall;
            // There is one format and one frame size: every probe is answered with them, and a commit must name
            // them.
            if (selector == UvcControl::kCommit) {
                if (wanted->format > 1 || wanted->frame > 1) return UsbAnswer::kStall;
                set_streaming(false);
                set_streaming(true);
            }
            return static_cast<int>(data.size());
        }
        case UvcRequest::kGetLength: return reply(data, kUvcProbeBytes, 2);
        case UvcRequest::kGetInfo: return reply(data, kCanGetAndSet, 1);
        case UvcRequest::kGetCurrent:
        case UvcRequest::kGetMinimum:
        case UvcRequest::kGetMaximum:
        case UvcRequest::kGetDefault: {
            const auto bytes = encode_uvc_probe(uvc_probe(format_));
            const std::size_t n = std::min(bytes.size(), data.size());
            std::copy_n(bytes.begin(), n, data.begin());
            return static_cast<int>(n);
        }
        default: return UsbAnswer::kStall;
    }
}

int UvcDevice::refuse(std::uint8_t code) noexcept {
    error_code_ = code;
    return UsbAnswer::kStall;
}

int UvcDevice::camera_control(const UsbSetup& setup, std::span<std::uint8_t> data) noexcept {
    const int unit = setup.index >> 8, selector = setup.value >> 8;
    if (unit == 0 && selector == UvcControl::kErrorCode)
        return setup.request == UvcRequest::kGetCurrent ? reply(data, error_code_, 1) : refuse(kNoSuchRequest);
    if (!controls_ || (unit != UvcIds::kCamera && unit != UvcIds::kProcessing)) return refuse(kNoSuchUnit);

    struct Setting {
        std::size_t bytes;
        std::uint32_t current, least, most, step, at_start;
    };
    const auto mode = [](const VideoControls& c) { return std::uint32_t{c.auto_exposure ? kAutomatic : kManual}; };
    const VideoControls& c = *controls_;
    Setting s{};
    const bool is_mode = unit == UvcIds::kCamera && selector == UvcControl::kExposureMode;
    const bool is_time = unit == UvcIds::kCamera && selector == UvcControl::kExposureTime;
    const bool is_gain = unit == UvcIds::kProcessing && selector == UvcControl::kGain;
    if (is_mode)  // a bit mask: GET_RES returns the supported modes
        s = {1, mode(c), kManual, kAutomatic, kManual | kAutomatic, mode(at_start_)};
    else if (is_time)
        s = {4,
             exposure_units(c.exposure_ns),
             exposure_units(c.exposure_min_ns + kUvcExposureUnit_ns - 1),
             exposure_units(c.exposure_max_ns),
             1,
             exposure_units(at_start_.exposure_ns)};
    else if (is_gain)
        s = {2, static_cast<std::uint32_t>(c.gain_cdb),        0, static_cast<std::uint32_t>(c.gain_max_cdb),
             1, static_cast<std::uint32_t>(at_start_.gain_cdb)};
    else
        return refuse(kNoSuchControl);

    error_code_ = 0;
    switch (setup.request) {
        case UvcRequest::kGetCurrent: return reply(data, s.current, s.bytes);
        case UvcRequest::kGetMinimum: return reply(data, s.least, s.bytes);
        case UvcRequest::kGetMaximum: return reply(data, s.most, s.bytes);
        case UvcRequest::kGetStep: return reply(data, s.step, s.bytes);
        case UvcRequest::kGetDefault: return reply(data, s.at_start, s.bytes);
        case UvcRequest::kGetLength: return reply(data, static_cast<std::uint32_t>(s.bytes), 2);
        case UvcRequest::kGetInfo: return reply(data, kCanGetAndSet, 1);
        case UvcRequest::kSetCurrent: break;
        default: return refuse(kNoSuchRequest);
    }
    if (data.size() != s.bytes) return refuse(kOutOfRange);
    std::array<std::uint8_t, 4> b{};
    std::ranges::copy(data, b.begin());
    const auto value = get_le<std::uint32_t>(b.data());
    if (value < s.least || value > s.most) return refuse(kOutOfRange);
    VideoRequest request;
    VideoControls wanted = c;
    if (is_mode) request.auto_exposure = wanted.auto_exposure = value == kAutomatic;
    if (is_time) request.exposure_ns = wanted.exposure_ns = value * kUvcExposureUnit_ns;
    if (is_gain) request.gain_cdb = wanted.gain_cdb = static_cast<std::int16_t>(value);
    if (!requests_.push(request)) return refuse(kOutOfRange);  // faster than the camera can follow
    controls_ = wanted;
    return static_cast<int>(s.bytes);
}

int UvcDevice::take(int /*endpoint*/, std::span<const std::uint8_t> /*data*/) noexcept {
    return UsbAnswer::kStall;
}

int UvcDevice::give(int endpoint, std::span<std::uint8_t> room) noexcept {
    if (endpoint != UvcIds::kStream || room.size() <= kUvcHeaderBytes) return UsbAnswer::kStall;
    const std::lock_guard lock(mutex_);
    if (!streaming_ || frame_.empty()) return UsbAnswer::kPending;
    const std::size_t n =
        std::min({frame_.size(), room.size() - kUvcHeaderBytes, kUvcPayloadBytes - kUvcHeaderBytes});
    const std::int64_t now_ns = monotonic_ns();
    encode_uvc_header({frame_id_, n == frame_.size(), uvc_ticks(t_frame_ns_), uvc_ticks(now_ns),
                       static_cast<std::uint16_t>(now_ns / 1'000'000 & 0x7ff)},
                      room.first<kUvcHeaderBytes>());
    std::copy_n(frame_.begin(), n, room.begin() + kUvcHeaderBytes);
    frame_ = frame_.subspan(n);
    if (frame_.empty()) {
        frame_id_ = !frame_id_;
        changed_.notify_all();
    }
    return static_cast<int>(kUvcHeaderBytes + n);
}

// --- The thread that has the frames ----------------------------------

UvcDevice::Shown UvcDevice::show(std::span<const std::uint8_t> frame, std::int64_t t_ns,
                                 const std::function<void()>& wake, const std::function<bool()>& gives_up) {
    std::unique_lock lock(mutex_);
    if (!streaming_) return Shown::no_stream;
    const std::uint64_t stream = streams();
    frame_ = frame;
    t_frame_ns_ = t_ns;
    const bool id = frame_id_;
    lock.unlock();
    wake();
    lock.lock();
    const auto whole = [&] { return streaming_ && streams() == stream && frame_id_ != id; };
    while (!frame_.empty() && streaming_ && streams() == stream) {
        if (gives_up()) break;
        changed_.wait_for(lock, std::chrono::milliseconds(20));
    }
    if (whole()) return Shown::whole;
    if (streams() == stream) frame_ = {};
    return Shown::broken;
}

}  // namespace narpa
