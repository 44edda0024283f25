#ifdef NARPA_WITH_USB

#include "drivers/can/gs_usb_link.h"

#include <sys/eventfd.h>

#include <algorithm>
#include <utility>

#include "base/time.h"

namespace narpa {
namespace {

constexpr std::int64_t kRestart_ns = 100'000'000;  // after bus-off, as `restart-ms 100` of ip-link
constexpr int kMaxErrorsInARow = 64;
constexpr std::int64_t kEchoTimeout_ns = 2 * kSecond_ns;
constexpr std::size_t kReceiveBytes = 512;  // a packet of a high-speed endpoint

// As in the table of Linux' gs_usb driver.
constexpr std::array<UsbId, 4> kAdapterIds{
    {{0x1d50, 0x606f}, {0x1209, 0x2323}, {0x1cd2, 0x606f}, {0x16d0, 0x10b8}}};
constexpr UsbKind kAdapters{"USB-CAN adapter", "usb:", kAdapterIds,
                            "lsusb -d 1d50:606f   (what the machine sees), or narpa-usbcan for one in software"};

Error bad_answer(const char* what) {
    return {.what = std::string("does not speak gs_usb: ") + what + " cannot be read", .kind = ErrorKind::missing};
}

}  // namespace

const UsbKind& gs_usb_kind() noexcept {
    return kAdapters;
}

std::int64_t GsUsbClock::to_monotonic(std::uint32_t time_us, std::int64_t t_now_ns) noexcept {
    if (!started_) started_ = true, last_us_ = time_us, offset_ns_ = t_now_ns - t_ns_, seen_ns_ = t_now_ns;
    t_ns_ += std::int64_t{static_cast<std::int32_t>(time_us - last_us_)} * 1000;
    last_us_ = time_us;
    offset_ns_ = std::min(offset_ns_ + (t_now_ns - seen_ns_) / 10'000, t_now_ns - t_ns_);
    seen_ns_ = t_now_ns;
    return t_ns_ + offset_ns_;
}

// --- Start and end ---------------------------------------------------

Result<std::unique_ptr<GsUsbLink>> GsUsbLink::open(const UsbCanSpec& spec, GsUsbShared& shared) {
    auto link = std::unique_ptr<GsUsbLink>(new GsUsbLink(spec, shared));
    auto usb = UsbLink::open(kAdapters, spec.adapter, *link, {kIns, kReceiveBytes}, {kOuts, kGsUsbFrameMostBytes},
                             shared.wanted.get());
    if (!usb) return usb.error();
    link->usb_ = *std::move(usb);
    if (auto started = link->start(); !started) {
        Error e = started.error();
        e.what = std::string(kAdapters.name) + " " + link->name() + ": " + e.what;
        return e;
    }
    return link;
}

GsUsbLink::~GsUsbLink() {
    if (usb_ && !usb_->gone()) (void)put(GsUsbRequest::mode, encode_gs_usb_mode({}), spec_.channel);
    usb_.reset();  // this still reports the end of transfers
    shared_.lost += static_cast<std::uint64_t>(std::ranges::count(places_, true, &Place::unconfirmed));
}

Status GsUsbLink::start() {
    if (auto good = set_up(); !good) return good.error();
    for (UsbTransfer& in : usb_->ins()) usb_->receive(in);
    if (auto good = put(GsUsbRequest::mode, encode_gs_usb_mode({true, wanted_features_}), spec_.channel); !good)
        return good.error();
    if (usb_->gone()) return Error{.what = "it takes no transfers", .kind = ErrorKind::missing};
    return Ok{};
}

Status GsUsbLink::set_up() {
    if (auto good = put(GsUsbRequest::host_format, kGsUsbHostFormat, 1); !good) return good.error();
    std::array<std::uint8_t, kGsUsbLimitsFdBytes> bytes{};
    auto n = get(GsUsbRequest::device_config, std::span(bytes).first(kGsUsbConfigBytes), 1);
    if (!n) return n.error();
    const auto config = decode_gs_usb_config(std::span(bytes).first(*n));
    if (!config) return bad_answer("its configuration");
    if (spec_.channel >= config->channels)
        return Error{"has channels 0 to " + std::to_string(config->channels - 1) + ", not " +
                     std::to_string(spec_.channel)};
    n = get(GsUsbRequest::bit_timing_limits, std::span(bytes).first(kGsUsbLimitsBytes), spec_.channel);
    if (!n) return n.error();
    auto limits = decode_gs_usb_limits(std::span(bytes).first(*n));
    if (!limits) return bad_answer("its bit timing limits");
    const std::uint32_t features = limits->features;
    fd_ = (features & GsUsbFeature::kFd) != 0;
    with_time_ = (features & GsUsbFeature::kTimeStamp) != 0;
    if (fd_ && (features & GsUsbFeature::kLimitsFd) != 0) {
        n = get(GsUsbRequest::bit_timing_limits_fd, bytes, spec_.channel);
        if (!n) return n.error();
        limits = decode_gs_usb_limits(std::span(bytes).first(*n));
        if (!limits || !limits->data) return bad_answer("its bit timing limits for CAN FD");
    }
    wanted_features_ = (fd_ ? GsUsbFeature::kFd : 0) | (with_time_ ? GsUsbFeature::kTimeStamp : 0);
    if (auto good = put(GsUsbRequest::mode, encode_gs_usb_mode({}), spec_.channel); !good) return good.error();
    return set_bit_rates(*limits);
}

Status GsUsbLink::set_bit_rates(const GsUsbLimits& limits) {
    const auto set = [&](GsUsbRequest request, std::uint32_t rate, const BitTimingRange& range) -> Status {
        const auto timing = bit_timing_of(rate, limits.clock_hz, range);
        if (!timing)
            return Error{"cannot make " + std::to_string(rate) + " bit/s of its clock of " +
                         std::to_string(limits.clock_hz) + " Hz"};
        return put(request, encode_gs_usb_bit_timing(*timing), spec_.channel);
    };
    auto good = set(GsUsbRequest::bit_timing, spec_.bit_rate, limits.nominal);
    if (good && fd_)
        good = set(GsUsbRequest::data_bit_timing, spec_.data_bit_rate, limits.data.value_or(limits.nominal));
    return good;
}

Status GsUsbLink::put(GsUsbRequest request, std::span<const std::uint8_t> data, std::uint16_t value) {
    return usb_->put(static_cast<std::uint8_t>(request), value, data);
}

Result<std::size_t> GsUsbLink::get(GsUsbRequest request, std::span<std::uint8_t> room, std::uint16_t value) {
    return usb_->get(static_cast<std::uint8_t>(request), value, room);
}

// --- Frames ----------------------------------------------------------

bool GsUsbLink::turn(std::int64_t timeout_ns) noexcept {
    usb_->serve(stalled_ ? 0 : timeout_ns);
    eventfd_t count = 0;
    ::eventfd_read(shared_.wanted.get(), &count);
    if (stalled_) recover();
    if (restart_ns_ != 0 && monotonic_ns() >= restart_ns_) restart();
    give_up_old_echoes();
    while (!usb_->gone() && restart_ns_ == 0 && send_next()) {
    }
    return !usb_->gone();
}

void GsUsbLink::received(UsbTransfer& transfer, UsbEnd end) noexcept {
    switch (end) {
        case UsbEnd::cancelled:
        case UsbEnd::gone: return;
        case UsbEnd::stalled:
            ++shared_.malformed;
            stalled_ = true;
            return;
        case UsbEnd::failed:
            ++shared_.malformed;
            if (++errors_in_a_row_ > kMaxErrorsInARow) transfer.link->give_up();
            break;
        case UsbEnd::whole:
        case UsbEnd::partial:
            errors_in_a_row_ = 0;
            if (transfer.moved > 0) take_frame(std::span(transfer.bytes).first(transfer.moved));
    }
    transfer.link->receive(transfer);
}

void GsUsbLink::take_frame(std::span<const std::uint8_t> bytes) noexcept {
    const std::int64_t t_now_ns = monotonic_ns();
    const auto f = decode_gs_usb_frame(bytes, with_time_);
    if (!f) return void(++shared_.malformed);
    if (f->channel != spec_.channel) return;
    const std::int64_t t_ns = with_time_ ? clock_.to_monotonic(f->time_us, t_now_ns) : t_now_ns;
    if (f->overflow) ++shared_.overflow;
    if (f->frame.error) {
        ++shared_.error_frames;
        if ((f->frame.id & CanErrorClass::kBusOff) == 0) return;
        ++shared_.bus_off;
        restart_ns_ = t_now_ns + kRestart_ns;
    } else if (f->echo != GsUsbFrame::kReceived) {
        confirm(f->echo);
    } else {
        if (!shared_.received.push({f->frame, t_ns})) ++shared_.overflow;
        ::eventfd_write(shared_.arrived.get(), 1);
    }
}

/// An echo identifier encodes the index and generation of a place: adapters return any 32 bits but kReceived. As
/// long as no echo is lost, the identifiers are those of the Linux driver.
void GsUsbLink::confirm(std::uint32_t echo) noexcept {
    const std::uint32_t place = echo % kOuts, generation = echo / kOuts;
    if (generation > places_[place].generation)
        ++shared_.malformed;
    else if (generation == places_[place].generation)
        places_[place].unconfirmed = false;
    // Else the echo had timed out, and its frame already counts as lost.
}

/// Frees the places of echoes that the adapter may have lost.
void GsUsbLink::give_up_old_echoes() noexcept {
    const std::int64_t t_old_ns = monotonic_ns() - kEchoTimeout_ns;
    for (std::size_t i = 0; i < kOuts; ++i) {
        Place& p = places_[i];
        if (!p.unconfirmed || usb_->outs()[i].under_way || p.t_sent_ns > t_old_ns) continue;
        p.unconfirmed = false;
        p.generation = (p.generation + 1) % (GsUsbFrame::kReceived / kOuts);
        ++shared_.lost;
    }
}

bool GsUsbLink::send_next() noexcept {
    const auto outs = usb_->outs();
    std::size_t slot = 0;
    while (slot < outs.size() && (outs[slot].under_way || places_[slot].unconfirmed)) ++slot;
    CanFrame frame;
    if (slot == outs.size() || !shared_.to_send.pop(frame)) return false;
    GsUsbFrame f;
    f.echo = static_cast<std::uint32_t>(slot + kOuts * places_[slot].generation);
    f.channel = spec_.channel;
    f.frame = frame;
    const std::size_t n = encode_gs_usb_frame(f, false, std::span(outs[slot].bytes).first<kGsUsbFrameMostBytes>());
    places_[slot].unconfirmed = true;
    places_[slot].t_sent_ns = monotonic_ns();
    return usb_->send(outs[slot], n);
}

void GsUsbLink::sent(UsbTransfer& transfer, UsbEnd end) noexcept {
    if (end == UsbEnd::whole) return;
    Place& place = places_[static_cast<std::size_t>(&transfer - transfer.link->outs().data())];
    if (std::exchange(place.unconfirmed, false)) ++shared_.lost;
    if (end != UsbEnd::cancelled) transfer.link->give_up();  // the adapter is opened again
}

/// Clears a stall of the endpoint towards the host and goes on reading.
void GsUsbLink::recover() noexcept {
    stalled_ = false;
    if (usb_->gone()) return;
    if (++errors_in_a_row_ > kMaxErrorsInARow || !usb_->clear_halt_in()) return usb_->give_up();
    for (UsbTransfer& in : usb_->ins())
        if (!in.under_way) usb_->receive(in);
}

/// Restarts the channel after bus-off. Frames without echo count as lost.
void GsUsbLink::restart() noexcept {
    restart_ns_ = 0;
    for (std::size_t i = 0; i < kOuts; ++i)
        if (!usb_->outs()[i].under_way && std::exchange(places_[i].unconfirmed, false)) ++shared_.lost;
    if (!put(GsUsbRequest::mode, encode_gs_usb_mode({}), spec_.channel) ||
        !put(GsUsbRequest::mode, encode_gs_usb_mode({true, wanted_features_}), spec_.channel))
        usb_->give_up();
}

}  // namespace narpa

#endif
