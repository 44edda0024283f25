// A USB-CAN adapter with candleLight firmware (gs_usb) as a bus, through libusb: no kernel driver takes part. Wire:
// protocols/usb/gs_usb.h.
//
// libusb allocates with every transfer and takes locks, and an adapter is opened again with transfers that wait. So
// all of it has a thread of its own; between it and the loop are two rings.
#include "drivers/can/buses.h"
#include "drivers/can/usb_adapters.h"
#include "drivers/can/usb_spec.h"

#ifdef NARPA_WITH_USB

#include <libusb-1.0/libusb.h>
#include <sys/eventfd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <cstring>
#include <exception>
#include <thread>

#include "base/spsc_ring.h"
#include "drivers/background_thread.h"
#include "drivers/can/descriptor.h"
#include "protocols/little_endian.h"
#include "protocols/usb/gs_usb.h"

namespace narpa {
namespace {

constexpr unsigned kControlPatience_ms = 1000;
constexpr std::int64_t kRestart_ns = 100'000'000;  // after bus-off, as `restart-ms 100` of ip-link
constexpr std::int64_t kFarewell_ns = 2 * kSecond_ns;
constexpr int kMostErrorsInARow = 64;

struct UsbId {
    std::uint16_t vendor, product;
};
// As in the table of Linux' gs_usb driver.
constexpr std::array<UsbId, 4> kAdapterIds{
    {{0x1d50, 0x606f}, {0x1209, 0x2323}, {0x1cd2, 0x606f}, {0x16d0, 0x10b8}}};

struct UsbExit {
    void operator()(libusb_context* c) const noexcept { libusb_exit(c); }
    void operator()(libusb_device_handle* h) const noexcept { libusb_close(h); }
    void operator()(libusb_transfer* t) const noexcept { libusb_free_transfer(t); }
    void operator()(libusb_config_descriptor* c) const noexcept { libusb_free_config_descriptor(c); }
};
template <class T>
using UsbOwned = std::unique_ptr<T, UsbExit>;

Error usb_error(const std::string& what, int code) {
    Error e{.what = what + ": " + libusb_strerror(static_cast<libusb_error>(code)), .kind = ErrorKind::missing};
    if (code == LIBUSB_ERROR_ACCESS) e.remedy = usb_permission_remedy();
    if (code == LIBUSB_ERROR_BUSY) e.remedy = "close the other program that uses the adapter";
    return e;
}

Result<UsbOwned<libusb_context>> usb_context() {
    libusb_context* context = nullptr;
    if (const int code = libusb_init(&context); code != 0) return usb_error("USB cannot be reached here", code);
    return UsbOwned<libusb_context>(context);
}

/// Bus and ports, as Linux names the place of a plug.
std::string place_of(libusb_device* device) {
    std::array<std::uint8_t, 8> ports{};
    const int n = libusb_get_port_numbers(device, ports.data(), static_cast<int>(ports.size()));
    std::string place = std::to_string(libusb_get_bus_number(device));
    for (int i = 0; i < n; ++i) place += (i == 0 ? "-" : ".") + std::to_string(ports[static_cast<std::size_t>(i)]);
    return place;
}

std::string serial_of(libusb_device_handle* handle, std::uint8_t string) {
    std::array<unsigned char, 128> text{};
    const int n = string == 0 ? 0 : libusb_get_string_descriptor_ascii(handle, string, text.data(), text.size());
    return {reinterpret_cast<const char*>(text.data()), static_cast<std::size_t>(std::max(n, 0))};
}

/// An adapter that is plugged in, open where it may be.
struct FoundAdapter {
    UsbAdapter what;
    int code = 0;  // of libusb_open
    UsbOwned<libusb_device_handle> handle;
};

std::vector<FoundAdapter> list_adapters(libusb_context* context) {
    std::vector<FoundAdapter> found;
    libusb_device** devices = nullptr;
    const ssize_t n = libusb_get_device_list(context, &devices);
    for (ssize_t i = 0; i < n; ++i) {
        libusb_device_descriptor d{};
        if (libusb_get_device_descriptor(devices[i], &d) != 0) continue;
        if (std::ranges::none_of(kAdapterIds,
                                 [&](UsbId id) { return id.vendor == d.idVendor && id.product == d.idProduct; }))
            continue;
        FoundAdapter a{{place_of(devices[i])}, 0, nullptr};
        libusb_device_handle* handle = nullptr;
        a.code = libusb_open(devices[i], &handle);
        a.handle.reset(handle);
        if (handle)
            a.what.serial = serial_of(handle, d.iSerialNumber);
        else
            a.what.trouble = libusb_strerror(static_cast<libusb_error>(a.code));
        found.push_back(std::move(a));
    }
    if (n >= 0) libusb_free_device_list(devices, 1);
    return found;
}

std::string names_of(const std::vector<FoundAdapter>& adapters) {
    std::string text;
    for (const FoundAdapter& a : adapters)
        text += (text.empty() ? "usb:" : ", usb:") + (a.what.serial.empty() ? a.what.place : a.what.serial);
    return text;
}

/// The one that is meant, open.
Result<FoundAdapter> choose(std::vector<FoundAdapter> adapters, const std::string& wanted) {
    if (adapters.empty())
        return Error{.what = "no USB-CAN adapter (gs_usb) is plugged in",
                     .kind = ErrorKind::missing,
                     .remedy = "lsusb -d 1d50:606f   (what the machine sees), or narpa-usbcan for one in software"};
    const auto meant = [&](const FoundAdapter& a) {
        return wanted.empty() || a.what.serial == wanted || a.what.place == wanted;
    };
    const auto count = std::ranges::count_if(adapters, meant);
    if (count > 1)
        return Error{std::to_string(count) + " USB-CAN adapters are plugged in: expected one of " +
                     names_of(adapters)};
    const auto it = std::ranges::find_if(adapters, meant);
    if (it == adapters.end()) {
        const auto shut = std::ranges::find_if(adapters, [](const FoundAdapter& a) { return !a.handle; });
        if (shut != adapters.end()) return usb_error("adapter " + shut->what.place, shut->code);
        return Error{.what = "no adapter \"" + wanted + "\" is plugged in; there is " + names_of(adapters),
                     .kind = ErrorKind::missing};
    }
    if (!it->handle) return usb_error("adapter " + it->what.place, it->code);
    return std::move(*it);
}

/// What the two threads share.
struct UsbCanShared {
    SpscRing<ReceivedFrame, 8192> received;
    SpscRing<CanFrame, 1024> to_send;
    Descriptor arrived, wanted;  // eventfds: for the loop, for the thread
    std::atomic<bool> connected{false}, carries_fd{false}, ending{false};
    std::atomic<std::uint64_t> overflow{0}, malformed{0}, error_frames{0}, bus_off{0}, down{0};
    std::atomic<std::uint64_t> lost{0};  // taken by send(), never confirmed
};

/// The adapter's clock, which counts microseconds and wraps, against ours: the least delay seen so far is taken for
/// none, and may grow by 100 ppm for clocks that drift apart.
class AdapterClock {
public:
    [[nodiscard]] std::int64_t to_monotonic(std::uint32_t time_us, std::int64_t t_now_ns) noexcept {
        if (!started_) started_ = true, last_us_ = time_us, offset_ns_ = t_now_ns - t_ns_, seen_ns_ = t_now_ns;
        t_ns_ += std::int64_t{static_cast<std::int32_t>(time_us - last_us_)} * 1000;
        last_us_ = time_us;
        offset_ns_ = std::min(offset_ns_ + (t_now_ns - seen_ns_) / 10'000, t_now_ns - t_ns_);
        seen_ns_ = t_now_ns;
        return t_ns_ + offset_ns_;
    }

private:
    bool started_ = false;
    std::uint32_t last_us_ = 0;
    std::int64_t t_ns_ = 0, offset_ns_ = 0, seen_ns_ = 0;
};

/// One adapter from plugging in to pulling out, on the thread of libusb.
class AdapterLink {
public:
    static Result<std::unique_ptr<AdapterLink>> open(const UsbCanSpec& spec, UsbCanShared& shared) {
        auto context = usb_context();
        if (!context) return context.error();
        auto found = choose(list_adapters(context->get()), spec.adapter);
        if (!found) return found.error();
        auto link =
            std::unique_ptr<AdapterLink>(new AdapterLink(*std::move(context), *std::move(found), spec, shared));
        if (auto started = link->start(); !started) {
            Error e = started.error();
            e.what = "adapter " + link->name() + ": " + e.what;
            return e;
        }
        return link;
    }

    ~AdapterLink() {
        if (claimed_) {
            if (!gone_) (void)put(GsUsbRequest::mode, encode_gs_usb_mode({}), spec_.channel);
            cancel_all();
            libusb_release_interface(handle_.get(), interface_);  // gives it back to the kernel's driver
        }
        if (under_way() > 0) {  // libusb still has them: their memory must outlive this
            for (In& in : in_) (void)in.transfer.release();
            for (Out& out : out_) (void)out.transfer.release();
            (void)handle_.release(), (void)context_.release();
            (void)new auto(std::move(in_)), (void)new auto(std::move(out_));
        }
        shared_.lost += unconfirmed();
    }
    AdapterLink(const AdapterLink&) = delete;
    AdapterLink& operator=(const AdapterLink&) = delete;

    [[nodiscard]] std::string name() const { return serial_.empty() ? place_ : serial_; }
    [[nodiscard]] bool carries_fd() const noexcept { return fd_; }

    /// Waits for events, at most timeout_ns, and serves them. False: the adapter has gone.
    bool turn(std::int64_t timeout_ns) noexcept {
        wait_ready(fds_, stalled_ ? 0 : timeout_ns);
        eventfd_t count = 0;
        ::eventfd_read(shared_.wanted.get(), &count);
        handle_events();
        if (stalled_) recover();
        if (restart_ns_ != 0 && monotonic_ns() >= restart_ns_) restart();
        while (!gone_ && restart_ns_ == 0 && send_next()) {
        }
        return !gone_;
    }

private:
    struct In {
        AdapterLink* link = nullptr;
        UsbOwned<libusb_transfer> transfer;
        bool under_way = false;
        std::array<std::uint8_t, 512> bytes{};
    };
    struct Out {
        AdapterLink* link = nullptr;
        UsbOwned<libusb_transfer> transfer;
        bool under_way = false, unconfirmed = false;  // unconfirmed: its echo has not come
        std::array<std::uint8_t, kGsUsbFrameMostBytes> bytes{};
    };
    static constexpr std::size_t kIns = 32, kOuts = 10;  // Linux' driver has 30 and 10

    AdapterLink(UsbOwned<libusb_context> context, FoundAdapter found, const UsbCanSpec& spec, UsbCanShared& shared)
        : context_(std::move(context)),
          handle_(std::move(found.handle)),
          place_(found.what.place),
          serial_(found.what.serial),
          spec_(spec),
          shared_(shared),
          in_(kIns),
          out_(kOuts) {}

    // --- Start ---

    Status start() {
        if (auto found = find_endpoints(); !found) return found.error();
        libusb_set_auto_detach_kernel_driver(handle_.get(), 1);
        if (const int code = libusb_claim_interface(handle_.get(), interface_); code != 0)
            return usb_error("cannot be claimed", code);
        claimed_ = true;
        if (auto good = set_up(); !good) return good.error();
        for (In& in : in_) {
            in.link = this;
            in.transfer.reset(libusb_alloc_transfer(0));
            if (!in.transfer) return Error{.what = "no memory", .kind = ErrorKind::failed};
            libusb_fill_bulk_transfer(in.transfer.get(), handle_.get(), endpoint_in_, in.bytes.data(),
                                      static_cast<int>(in.bytes.size()), on_in, &in, 0);
        }
        for (Out& out : out_) {
            out.link = this;
            out.transfer.reset(libusb_alloc_transfer(0));
            if (!out.transfer) return Error{.what = "no memory", .kind = ErrorKind::failed};
        }
        for (In& in : in_) submit(in);
        if (auto good = put(GsUsbRequest::mode, encode_gs_usb_mode({true, wanted_features_}), spec_.channel); !good)
            return good.error();
        if (gone_) return Error{.what = "it takes no transfers", .kind = ErrorKind::missing};
        const libusb_pollfd** fds = libusb_get_pollfds(context_.get());
        for (const libusb_pollfd** fd = fds; fds && *fd; ++fd) fds_.push_back({(*fd)->fd, (*fd)->events, 0});
        libusb_free_pollfds(fds);
        fds_.push_back({shared_.wanted.get(), POLLIN, 0});
        return Ok{};
    }

    Status find_endpoints() {
        libusb_config_descriptor* raw = nullptr;
        if (const int code = libusb_get_active_config_descriptor(libusb_get_device(handle_.get()), &raw); code != 0)
            return usb_error("has no configuration", code);
        const UsbOwned<libusb_config_descriptor> config(raw);
        for (int i = 0; i < config->bNumInterfaces; ++i) {
            if (config->interface[i].num_altsetting < 1) continue;
            const libusb_interface_descriptor& d = config->interface[i].altsetting[0];
            if (d.bInterfaceClass != LIBUSB_CLASS_VENDOR_SPEC) continue;
            endpoint_in_ = endpoint_out_ = 0;
            for (int e = 0; e < d.bNumEndpoints; ++e) {
                const libusb_endpoint_descriptor& endpoint = d.endpoint[e];
                if ((endpoint.bmAttributes & 3) != LIBUSB_TRANSFER_TYPE_BULK) continue;
                const bool is_in = (endpoint.bEndpointAddress & LIBUSB_ENDPOINT_IN) != 0;
                std::uint8_t& mine = is_in ? endpoint_in_ : endpoint_out_;
                if (mine == 0) mine = endpoint.bEndpointAddress;
            }
            interface_ = d.bInterfaceNumber;
            if (endpoint_in_ != 0 && endpoint_out_ != 0) return Ok{};
        }
        return Error{.what = "has no interface with two bulk endpoints, as gs_usb has", .kind = ErrorKind::missing};
    }

    Status set_up() {
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
        const auto set = [&](GsUsbRequest request, std::uint32_t rate, const BitTimingRange& range) -> Status {
            const auto timing = bit_timing_of(rate, limits->clock_hz, range);
            if (!timing)
                return Error{"cannot make " + std::to_string(rate) + " bit/s of its clock of " +
                             std::to_string(limits->clock_hz) + " Hz"};
            return put(request, encode_gs_usb_bit_timing(*timing), spec_.channel);
        };
        auto good = set(GsUsbRequest::bit_timing, spec_.bit_rate, limits->nominal);
        if (good && fd_)
            good = set(GsUsbRequest::data_bit_timing, spec_.data_bit_rate, limits->data.value_or(limits->nominal));
        return good;
    }

    static Error bad_answer(const char* what) {
        return {.what = std::string("does not speak gs_usb: ") + what + " cannot be read",
                .kind = ErrorKind::missing};
    }

    Status put(GsUsbRequest request, std::span<const std::uint8_t> data, std::uint16_t value) {
        std::array<std::uint8_t, 64> copy{};
        std::ranges::copy(data, copy.begin());
        const int n = libusb_control_transfer(handle_.get(), 0x41, static_cast<std::uint8_t>(request), value,
                                              static_cast<std::uint16_t>(interface_), copy.data(),
                                              static_cast<std::uint16_t>(data.size()), kControlPatience_ms);
        if (n == static_cast<int>(data.size())) return Ok{};
        return usb_error("refuses request " + std::to_string(static_cast<int>(request)),
                         n < 0 ? n : LIBUSB_ERROR_IO);
    }
    Result<std::size_t> get(GsUsbRequest request, std::span<std::uint8_t> room, std::uint16_t value) {
        const int n = libusb_control_transfer(handle_.get(), 0xC1, static_cast<std::uint8_t>(request), value,
                                              static_cast<std::uint16_t>(interface_), room.data(),
                                              static_cast<std::uint16_t>(room.size()), kControlPatience_ms);
        if (n >= 0) return static_cast<std::size_t>(n);
        return usb_error("refuses request " + std::to_string(static_cast<int>(request)), n);
    }

    // --- Transfers ---

    void submit(In& in) noexcept {
        const int code = libusb_submit_transfer(in.transfer.get());
        in.under_way = code == 0;
        if (code != 0) gone_ = true;
    }

    static void LIBUSB_CALL on_in(libusb_transfer* t) {
        In& in = *static_cast<In*>(t->user_data);
        in.under_way = false;
        in.link->take(in);
    }

    void take(In& in) noexcept {
        const libusb_transfer& t = *in.transfer;
        switch (t.status) {
            case LIBUSB_TRANSFER_COMPLETED:
                errors_in_a_row_ = 0;
                if (t.actual_length > 0) take_frame({in.bytes.data(), static_cast<std::size_t>(t.actual_length)});
                break;
            case LIBUSB_TRANSFER_CANCELLED: return;
            case LIBUSB_TRANSFER_NO_DEVICE: gone_ = true; return;
            case LIBUSB_TRANSFER_STALL:
                ++shared_.malformed;
                stalled_ = true;
                return;
            default:  // more than was asked for, or an error of the wire
                ++shared_.malformed;
                if (++errors_in_a_row_ > kMostErrorsInARow) gone_ = true;
        }
        if (!gone_ && !closing_) submit(in);
    }

    void take_frame(std::span<const std::uint8_t> bytes) noexcept {
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
            if (f->echo < out_.size())
                out_[f->echo].unconfirmed = false;
            else
                ++shared_.malformed;
        } else {
            if (!shared_.received.push({f->frame, t_ns})) ++shared_.overflow;
            ::eventfd_write(shared_.arrived.get(), 1);
        }
    }

    bool send_next() noexcept {
        const auto slot = std::ranges::find_if(out_, [](const Out& o) { return !o.under_way && !o.unconfirmed; });
        CanFrame frame;
        if (slot == out_.end() || !shared_.to_send.pop(frame)) return false;
        GsUsbFrame f;
        f.echo = static_cast<std::uint32_t>(slot - out_.begin());
        f.channel = spec_.channel;
        f.frame = frame;
        const std::size_t n = encode_gs_usb_frame(f, false, slot->bytes);
        libusb_fill_bulk_transfer(slot->transfer.get(), handle_.get(), endpoint_out_, slot->bytes.data(),
                                  static_cast<int>(n), on_out, &*slot, 0);
        slot->unconfirmed = true;
        slot->under_way = libusb_submit_transfer(slot->transfer.get()) == 0;
        if (!slot->under_way) gone_ = true;
        return slot->under_way;
    }

    static void LIBUSB_CALL on_out(libusb_transfer* t) {
        Out& out = *static_cast<Out*>(t->user_data);
        AdapterLink& link = *out.link;
        out.under_way = false;
        if (t->status == LIBUSB_TRANSFER_COMPLETED && t->actual_length == t->length) return;
        if (out.unconfirmed) ++link.shared_.lost;
        out.unconfirmed = false;
        if (t->status != LIBUSB_TRANSFER_CANCELLED) link.gone_ = true;  // the adapter is opened anew
    }

    void handle_events() noexcept {
        timeval now{};
        if (const int code = libusb_handle_events_timeout_completed(context_.get(), &now, nullptr);
            code == LIBUSB_ERROR_NO_DEVICE)
            gone_ = true;
    }

    /// The endpoint has stalled: cleared, it goes on.
    void recover() noexcept {
        stalled_ = false;
        if (gone_) return;
        if (++errors_in_a_row_ > kMostErrorsInARow || libusb_clear_halt(handle_.get(), endpoint_in_) != 0)
            return void(gone_ = true);
        for (In& in : in_)
            if (!in.under_way && !gone_) submit(in);
    }

    /// After bus-off. What was under way on the bus is lost.
    void restart() noexcept {
        restart_ns_ = 0;
        for (Out& out : out_)
            if (!out.under_way && out.unconfirmed) {
                out.unconfirmed = false;
                ++shared_.lost;
            }
        if (!put(GsUsbRequest::mode, encode_gs_usb_mode({}), spec_.channel) ||
            !put(GsUsbRequest::mode, encode_gs_usb_mode({true, wanted_features_}), spec_.channel))
            gone_ = true;
    }

    void cancel_all() noexcept {
        closing_ = true;
        for (In& in : in_)
            if (in.under_way) libusb_cancel_transfer(in.transfer.get());
        for (Out& out : out_)
            if (out.under_way) libusb_cancel_transfer(out.transfer.get());
        for (const std::int64_t until_ns = monotonic_ns() + kFarewell_ns;
             under_way() > 0 && monotonic_ns() < until_ns;) {
            timeval soon{0, 10'000};
            libusb_handle_events_timeout_completed(context_.get(), &soon, nullptr);
        }
    }
    [[nodiscard]] std::size_t under_way() const noexcept {
        const auto flies = [](const auto& t) { return t.under_way; };
        return static_cast<std::size_t>(std::ranges::count_if(in_, flies) + std::ranges::count_if(out_, flies));
    }
    [[nodiscard]] std::uint64_t unconfirmed() const noexcept {
        return static_cast<std::uint64_t>(std::ranges::count_if(out_, [](const Out& o) { return o.unconfirmed; }));
    }

    UsbOwned<libusb_context> context_;
    UsbOwned<libusb_device_handle> handle_;
    std::string place_, serial_;
    UsbCanSpec spec_;
    UsbCanShared& shared_;
    std::vector<In> in_;
    std::vector<Out> out_;
    std::vector<pollfd> fds_;
    int interface_ = 0;
    std::uint8_t endpoint_in_ = 0, endpoint_out_ = 0;
    std::uint32_t wanted_features_ = 0;
    bool claimed_ = false, fd_ = false, with_time_ = false, gone_ = false, stalled_ = false, closing_ = false;
    int errors_in_a_row_ = 0;
    std::int64_t restart_ns_ = 0;  // 0: none is due
    AdapterClock clock_;
};

class UsbCanBus final : public CanBus {
public:
    /// `first`: open.
    UsbCanBus(UsbCanSpec spec, std::unique_ptr<UsbCanShared> shared, std::unique_ptr<AdapterLink> first)
        : spec_(std::move(spec)), shared_(std::move(shared)) {
        spec_.adapter = first->name();  // the same one when it is plugged in again
        shared_->carries_fd = first->carries_fd();
        shared_->connected = true;
        link_ = std::move(first);
        thread_ = start_without_signals([this] { run(); });
    }
    ~UsbCanBus() override {
        shared_->ending.store(true, std::memory_order_release);
        ::eventfd_write(shared_->wanted.get(), 1);
        thread_.join();
    }

    [[nodiscard]] bool receive(ReceivedFrame& out) noexcept override {
        const bool any = shared_->received.pop(out);
        if (any) ++counters_.received;
        account();
        return any;
    }

    bool send(const CanFrame& frame) noexcept override {
        const bool taken = sendable(frame) && (!frame.fd || carries_fd()) &&
                           shared_->connected.load(std::memory_order_acquire) && shared_->to_send.push(frame);
        if (taken) ::eventfd_write(shared_->wanted.get(), 1);
        ++(taken ? taken_ : refused_);
        account();
        return taken;
    }

    void wait(std::int64_t timeout_ns) noexcept override {
        std::array<pollfd, 2> fds{{{shared_->arrived.get(), POLLIN, 0}, {wake_fd_, POLLIN, 0}}};
        wait_ready(fds, timeout_ns);
        eventfd_t count = 0;
        ::eventfd_read(shared_->arrived.get(), &count);
        account();
    }

    [[nodiscard]] bool carries_fd() const noexcept override {
        return shared_->carries_fd.load(std::memory_order_relaxed);
    }
    [[nodiscard]] std::string description() const override {
        std::string text = "gs_usb: adapter " + spec_.adapter + ", channel " + std::to_string(spec_.channel) +
                           ", " + std::to_string(spec_.bit_rate) + " bit/s";
        return text + (carries_fd() ? " (CAN FD, data " + std::to_string(spec_.data_bit_rate) + " bit/s)"
                                    : " (classic CAN)");
    }

private:
    static constexpr std::int64_t kTurn_ns = 100'000'000;

    /// What the thread has counted. `sent` are the frames that the bus has or may still get.
    void account() noexcept {
        const UsbCanShared& s = *shared_;
        const std::uint64_t lost = s.lost.load(std::memory_order_relaxed);
        counters_.sent = taken_ - lost;
        counters_.send_drops = refused_ + lost;
        counters_.receive_overflow = s.overflow.load(std::memory_order_relaxed);
        counters_.malformed = s.malformed.load(std::memory_order_relaxed);
        counters_.error_frames = s.error_frames.load(std::memory_order_relaxed);
        counters_.bus_off = s.bus_off.load(std::memory_order_relaxed);
        counters_.interface_down = s.down.load(std::memory_order_relaxed);
    }

    // --- The thread ---

    void run() noexcept {
        RetryTimer retry;
        while (!shared_->ending.load(std::memory_order_acquire)) {
            try {
                if (link_) {
                    if (!link_->turn(kTurn_ns)) lose();
                } else {
                    wait_without_adapter(retry);
                }
            } catch (const std::exception&) {  // no memory left: tried again
                lose();
            }
        }
        link_.reset();
    }

    void lose() noexcept {
        shared_->connected.store(false, std::memory_order_release);
        link_.reset();
        ++shared_->down;
    }

    void wait_without_adapter(RetryTimer& retry) {
        for (CanFrame dropped; shared_->to_send.pop(dropped);) ++shared_->lost;
        std::array<pollfd, 1> fds{{{shared_->wanted.get(), POLLIN, 0}}};
        wait_ready(fds, retry.limit(kTurn_ns));
        eventfd_t count = 0;
        ::eventfd_read(shared_->wanted.get(), &count);
        if (!retry.due()) return;
        auto link = AdapterLink::open(spec_, *shared_);
        if (!link) return;
        link_ = *std::move(link);
        shared_->carries_fd = link_->carries_fd();
        shared_->connected.store(true, std::memory_order_release);
    }

    UsbCanSpec spec_;
    std::unique_ptr<UsbCanShared> shared_;
    std::unique_ptr<AdapterLink> link_;  // the thread's
    std::uint64_t taken_ = 0, refused_ = 0;
    std::thread thread_;
};

}  // namespace

CanBusResult open_gs_usb(std::string_view text) {
    auto spec = parse_usb_can(text);
    if (!spec) return spec.error();
    auto shared = std::make_unique<UsbCanShared>();
    shared->arrived = Descriptor(::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK));
    shared->wanted = Descriptor(::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK));
    if (!shared->arrived || !shared->wanted)
        return Error{.what = std::string("usb: no descriptor is left: ") + std::strerror(errno),
                     .kind = ErrorKind::missing};
    auto link = AdapterLink::open(*spec, *shared);
    if (!link) {
        Error e = link.error();
        e.what = "usb:" + std::string(text) + ": " + e.what;
        return e;
    }
    return CanBusResult(std::make_unique<UsbCanBus>(*std::move(spec), std::move(shared), *std::move(link)));
}

Result<std::vector<UsbAdapter>> find_usb_adapters() {
    auto context = usb_context();
    if (!context) return context.error();
    std::vector<UsbAdapter> out;
    for (FoundAdapter& a : list_adapters(context->get())) out.push_back(std::move(a.what));
    return out;
}

}  // namespace narpa

#else

namespace narpa {
namespace {

Error built_without_usb() {
    return {.what = "this narpa was built without USB",
            .kind = ErrorKind::missing,
            .remedy = "cmake -DNARPA_WITH_USB=ON ... (needs libusb-1.0-0-dev), and build again"};
}

}  // namespace

CanBusResult open_gs_usb(std::string_view text) {
    if (auto spec = parse_usb_can(text); !spec) return spec.error();
    return built_without_usb();
}
Result<std::vector<UsbAdapter>> find_usb_adapters() {
    return built_without_usb();
}

}  // namespace narpa

#endif

namespace narpa {

std::string usb_permission_remedy() {
    return "sudo cp drivers/usb/udev/70-narpa-usb.rules /etc/udev/rules.d/ && sudo udevadm control --reload && "
           "sudo udevadm trigger   (from the sources or from share/narpa; then plug the adapter in again)";
}

}  // namespace narpa
