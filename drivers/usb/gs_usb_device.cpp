#include "drivers/usb/gs_usb_device.h"

#include <sys/eventfd.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <system_error>
#include <utility>

#include "base/time.h"
#include "drivers/descriptor.h"
#include "protocols/little_endian.h"

namespace narpa {
namespace {

constexpr std::int64_t kRetry_ns = 1'000'000;  // interval between tries to send a frame that the bus does not take
constexpr BitTimingRange kDataRange{1, 32, 1, 16, 16, 1, 32, 1};

UsbDescriptors adapter_descriptors(std::string serial) {
    UsbDescriptors d;
    d.device.vendor = GsUsbDevice::kVendor, d.device.product = GsUsbDevice::kProduct;
    d.device.maker_string = 1, d.device.product_string = 2, d.device.serial_string = 3;
    d.strings = {"narpa", "narpa-usbcan (gs_usb)", std::move(serial)};
    constexpr std::uint8_t kBulk = 2;
    d.configuration = UsbConfigurationWriter(1, 100)
                          .interface({0, 0, 0xff, 0xff, 0xff}, 2)
                          .endpoint({0x80 | GsUsbDevice::kIn, kBulk, 64})
                          .endpoint({GsUsbDevice::kOut, kBulk, 64})
                          .bytes();
    return d;
}

std::uint32_t device_time_us(std::int64_t t_ns) noexcept {
    return static_cast<std::uint32_t>(t_ns / 1000);
}

}  // namespace

GsUsbDevice::GsUsbDevice(std::string serial, bool fd)
    : fd_(fd), descriptors_(adapter_descriptors(std::move(serial))) {
    limits_.features = GsUsbFeature::kTimeStamp | GsUsbFeature::kState | GsUsbFeature::kErrorReports;
    limits_.nominal = {1, 256, 1, 128, 128, 1, 512, 1};
    limits_.clock_hz = 80'000'000;
    if (fd) limits_.features |= GsUsbFeature::kFd | GsUsbFeature::kLimitsFd;
    wake_fd_ = ::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
    if (wake_fd_ < 0) throw std::system_error(errno, std::generic_category(), "eventfd");
}

GsUsbDevice::~GsUsbDevice() {
    ::close(wake_fd_);
}

// --- The server's thread ---------------------------------------------

void GsUsbDevice::reset() noexcept {
    started_.store(false, std::memory_order_release);
    is_bus_off_.store(false, std::memory_order_release);
    session_.fetch_add(1, std::memory_order_acq_rel);
    for (Entry e; pop(e);)
        if (e.frame.echo == GsUsbFrame::kReceived && !e.frame.frame.error) ++missed_;
    ::eventfd_write(wake_fd_, 1);
}

void GsUsbDevice::plugged(bool /*in*/) noexcept {
    reset();
}

int GsUsbDevice::control(const UsbSetup& setup, std::span<std::uint8_t> data) noexcept {
    if (setup.kind() == 0) return 0;  // CLEAR_FEATURE, SET_INTERFACE: nothing to do
    if (setup.kind() != 2 || setup.recipient() != 1 || (setup.index & 0xff) != 0) return UsbAnswer::kStall;
    return setup.to_host() ? control_in(setup, data) : control_out(setup, data);
}

int GsUsbDevice::control_out(const UsbSetup& setup, std::span<const std::uint8_t> data) noexcept {
    const auto request = static_cast<GsUsbRequest>(setup.request);
    const auto taken = static_cast<int>(data.size());
    if (request == GsUsbRequest::host_format)
        return std::ranges::equal(data, kGsUsbHostFormat) ? taken : UsbAnswer::kStall;
    if (setup.value != 0) return UsbAnswer::kStall;  // there is one channel
    if (request == GsUsbRequest::bit_timing || (request == GsUsbRequest::data_bit_timing && fd_))
        return decode_gs_usb_bit_timing(data) ? taken : UsbAnswer::kStall;
    if (request != GsUsbRequest::mode) return UsbAnswer::kStall;
    const auto mode = decode_gs_usb_mode(data);
    if (!mode || (mode->features & ~limits_.features) != 0) return UsbAnswer::kStall;
    reset();
    with_time_ = (mode->features & GsUsbFeature::kTimeStamp) != 0;
    started_.store(mode->start, std::memory_order_release);
    return taken;
}

int GsUsbDevice::control_in(const UsbSetup& setup, std::span<std::uint8_t> data) noexcept {
    const auto answer = [&](std::span<const std::uint8_t> bytes) {
        const std::size_t n = std::min(bytes.size(), data.size());
        std::copy_n(bytes.begin(), n, data.begin());
        return static_cast<int>(n);
    };
    std::array<std::uint8_t, kGsUsbLimitsFdBytes> bytes{};
    switch (static_cast<GsUsbRequest>(setup.request)) {
        case GsUsbRequest::device_config: return answer(encode_gs_usb_config({}));
        case GsUsbRequest::bit_timing_limits:
            return answer(std::span(bytes).first(encode_gs_usb_limits(limits_, bytes)));
        case GsUsbRequest::bit_timing_limits_fd: {
            if (!fd_) return UsbAnswer::kStall;
            GsUsbLimits both = limits_;
            both.data = kDataRange;
            return answer(std::span(bytes).first(encode_gs_usb_limits(both, bytes)));
        }
        case GsUsbRequest::time_stamp:
            put_le(bytes.data(), device_time_us(monotonic_ns()));
            return answer(std::span(bytes).first(4));
        case GsUsbRequest::state: {
            constexpr std::uint32_t kActive = 0, kBusOff = 3, kStopped = 4;
            put_le(bytes.data(), !started() ? kStopped : is_bus_off_ ? kBusOff : kActive);
            return answer(std::span(bytes).first(12));
        }
        default: return UsbAnswer::kStall;
    }
}

int GsUsbDevice::take(int endpoint, std::span<const std::uint8_t> data) noexcept {
    if (endpoint != kOut) return UsbAnswer::kStall;
    const auto taken = static_cast<int>(data.size());
    const auto frame = decode_gs_usb_frame(data, false);
    if (!frame || frame->channel != 0 || frame->frame.error || (frame->frame.fd && !fd_)) {
        ++malformed_;
        return taken;
    }
    if (!started()) {
        ++abandoned_;
        return taken;
    }
    if (!from_host_.push({*frame, session_.load(std::memory_order_relaxed)})) return UsbAnswer::kPending;
    ::eventfd_write(wake_fd_, 1);
    return taken;
}

int GsUsbDevice::give(int endpoint, std::span<std::uint8_t> room) noexcept {
    if (endpoint != kIn) return UsbAnswer::kStall;
    Entry e;
    const std::uint32_t session = session_.load(std::memory_order_relaxed);
    while (pop(e)) {
        const bool is_received = e.frame.echo == GsUsbFrame::kReceived && !e.frame.frame.error;
        if (e.session != session) {
            if (is_received) ++missed_;
            continue;
        }
        e.frame.overflow = overflowed_.exchange(false, std::memory_order_relaxed);
        std::array<std::uint8_t, kGsUsbFrameMostBytes> bytes;
        const std::size_t n = encode_gs_usb_frame(e.frame, with_time_, bytes);
        if (n > room.size()) return UsbAnswer::kBabble;
        std::copy_n(bytes.begin(), n, room.begin());
        if (is_received) ++frames_to_host_;
        return static_cast<int>(n);
    }
    return UsbAnswer::kPending;
}

// --- The CAN thread --------------------------------------------------

bool GsUsbDevice::turn(CanBus& bus, std::int64_t timeout_ns) noexcept {
    if (sending_) timeout_ns = timeout_ns < 0 ? kRetry_ns : std::min(timeout_ns, kRetry_ns);
    bus.wake_by(sending_ ? -1 : wake_fd_);
    bus.wait(timeout_ns);
    eventfd_t count = 0;
    ::eventfd_read(wake_fd_, &count);
    bool wakes = from_bus(bus);
    wakes = to_bus(bus) || wakes;
    return mirror_errors(bus) || wakes;
}

bool GsUsbDevice::from_bus(CanBus& bus) noexcept {
    bool any = false;
    ReceivedFrame received;
    for (int i = 0; i < kFramesPerTurn && bus.receive(received); ++i) {
        GsUsbFrame f;
        f.frame = received.frame;
        f.time_us = device_time_us(received.t_received_ns);
        if (!started() || is_bus_off_)
            ++missed_;
        else if (push(f, kReserve))
            any = true;
        else
            ++overflow_;
    }
    return any;
}

bool GsUsbDevice::to_bus(CanBus& bus) noexcept {
    bool any = false;
    for (int i = 0; i < kFramesPerTurn; ++i) {
        if (!sending_) {
            Entry e;
            if (!from_host_.pop(e)) break;
            sending_ = e;
            any = true;  // there is room in from_host_ again
        }
        if (sending_->session != session_.load(std::memory_order_acquire) || is_bus_off_) {
            ++abandoned_;
            sending_.reset();
            continue;
        }
        if (!bus.send(sending_->frame.frame)) break;  // as a controller, try again until the bus takes it
        const std::uint64_t frames = ++frames_from_host_;
        sending_->frame.time_us = device_time_us(monotonic_ns());
        if (frames <= lose_echoes_after_ || frames % 2 == 0) (void)push(sending_->frame);
        sending_.reset();
        if (--bus_off_after_ == 0) report_bus_off();
    }
    return any;
}

/// Reports bus-off and error frames of the bus to the host. True: a report was queued.
bool GsUsbDevice::mirror_errors(const CanBus& bus) noexcept {
    const CanCounters& c = bus.counters();
    const bool was_bus_off = std::exchange(bus_off_seen_, c.bus_off) != c.bus_off;
    const bool had_errors = std::exchange(errors_seen_, c.error_frames) != c.error_frames;
    if (was_bus_off) report_bus_off();
    if (!had_errors || was_bus_off) return was_bus_off;
    GsUsbFrame f;
    f.frame.error = true;
    f.frame.id = CanErrorClass::kBusError;
    f.frame.size = 8;
    return push(f);
}

void GsUsbDevice::report_bus_off() noexcept {
    GsUsbFrame f;
    f.frame.error = true;
    f.frame.id = CanErrorClass::kBusOff;
    f.frame.size = 8;
    f.time_us = device_time_us(monotonic_ns());
    ++bus_off_;
    bus_off_after_ = UINT64_MAX;
    is_bus_off_ = true;
    (void)push(f);
}

bool GsUsbDevice::push(const GsUsbFrame& frame, std::size_t reserve) noexcept {
    const Entry entry{frame, session_.load(std::memory_order_acquire)};
    if (in_to_host_.load(std::memory_order_relaxed) + reserve < kToHost && to_host_.push(entry)) {
        in_to_host_.fetch_add(1, std::memory_order_relaxed);
        return true;
    }
    overflowed_.store(true, std::memory_order_relaxed);
    return false;
}

bool GsUsbDevice::pop(Entry& entry) noexcept {
    if (!to_host_.pop(entry)) return false;
    in_to_host_.fetch_sub(1, std::memory_order_relaxed);
    return true;
}

GsUsbDeviceCounters GsUsbDevice::counters() const noexcept {
    return {frames_from_host_, abandoned_, frames_to_host_, overflow_, missed_, malformed_, bus_off_};
}

}  // namespace narpa
