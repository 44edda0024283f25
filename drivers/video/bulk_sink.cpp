// Frames to an FPGA or FX3 over a bulk endpoint, through libusb, which allocates and takes locks: all of it happens
// on the queue's thread. Wire: protocols/video/bulk_frame.h.
#include "drivers/video/bulk_bridges.h"

#include <algorithm>
#include <array>
#include <limits>

#include "base/text/read_number.h"
#include "drivers/descriptor.h"
#include "drivers/usb/usb_link.h"
#include "drivers/video/backends.h"
#include "protocols/crc32.h"
#include "protocols/video/bulk_frame.h"

namespace narpa {

Result<BulkSpec> parse_bulk(std::string_view text) {
    BulkSpec spec;
    const Error expected{
        "bulk:" + std::string(text) +
        ": expected bulk:[VENDOR:PRODUCT/][SERIAL|BUS-PORT], such as bulk: or bulk:04b4:00f1/1-4.2"};
    std::string_view name = text;
    if (const std::size_t slash = text.find('/'); slash != std::string_view::npos) {
        const std::string_view id = text.substr(0, slash);
        UsbId wanted;
        if (id.size() != 9 || id[4] != ':' || !read_number(id.substr(0, 4), wanted.vendor, 16) ||
            !read_number(id.substr(5), wanted.product, 16))
            return expected;
        spec.id = wanted;
        name = text.substr(slash + 1);
    }
    if (!is_usb_name(name) || name.find_first_of(":/") != std::string_view::npos) return expected;
    spec.device = name;
    return spec;
}

namespace {

// A Cypress FX3 with the maker's examples, and narpa's own bridge in software.
constexpr std::array<UsbId, 2> kBridgeIds{{{0x04b4, 0x00f1}, {0x1209, 0x0002}}};

}  // namespace

#ifdef NARPA_WITH_USB

namespace {

constexpr std::size_t kTransfers = 8, kTransferBytes = 65536;
constexpr std::int64_t kBridgeTimeout_ns = kSecond_ns;  // without progress of the transfers
constexpr std::int64_t kServePeriod_ns = 20'000'000;    // how often the time that is left is checked

/// Splits a frame into transfers: an empty one that ends a frame that was cut short, header and pixels, and an
/// empty one if this frame would end with a full packet.
class FramePieces {
public:
    FramePieces(std::span<const std::uint8_t> header, std::span<const std::uint8_t> pixels, bool after_a_cut,
                std::size_t packet_bytes) noexcept
        : header_(header),
          pixels_(pixels),
          begins_with_end_(after_a_cut),
          ends_with_end_((header.size() + pixels.size()) % packet_bytes == 0) {}

    [[nodiscard]] bool empty() const noexcept {
        return !begins_with_end_ && header_.empty() && pixels_.empty() && !ends_with_end_;
    }
    /// Fills `room` and returns the length of the transfer, which may be 0.
    std::size_t next(std::span<std::uint8_t> room) noexcept {
        if (begins_with_end_) return begins_with_end_ = false, 0;
        if (header_.empty() && pixels_.empty()) return ends_with_end_ = false, 0;
        std::size_t n = 0;
        for (auto* rest : {&header_, &pixels_}) {
            const std::size_t part = std::min(rest->size(), room.size() - n);
            std::copy_n(rest->begin(), part, room.begin() + static_cast<std::ptrdiff_t>(n));
            *rest = rest->subspan(part);
            n += part;
        }
        return n;
    }

private:
    std::span<const std::uint8_t> header_, pixels_;
    bool begins_with_end_, ends_with_end_;
};

class BulkWriter final : public VideoWriter, UsbLink::Client {
public:
    BulkWriter(BulkSpec spec, const VideoFormat& format) : spec_(std::move(spec)), format_(format) {
        if (spec_.id) own_id_[0] = *spec_.id, kind_.ids = own_id_;
    }
    Status open() {
        auto link = UsbLink::open(kind_, spec_.device, *this, {}, {kTransfers, kTransferBytes}, -1);
        if (!link) return link.error();
        link_ = *std::move(link);
        spec_.device = link_->name();  // the same one when it is plugged in again
        cut_ = true;                   // bytes of an earlier frame may be in the bridge
        return Ok{};
    }
    [[nodiscard]] std::string description() const {
        return "USB frame bridge " + spec_.device + ", packets of " + std::to_string(link_->out_packet_bytes()) +
               " bytes";
    }

    void write_frame(std::span<const std::uint8_t> pixels, const FrameStamp& stamp,
                     const WriteQueue& queue) noexcept override {
        if (!link_ && !reopen()) return void(++failed);
        const auto header =
            encode_bulk_header({stamp.t_ns, stamp.number, format_.pixel, static_cast<std::uint32_t>(format_.width),
                                static_cast<std::uint32_t>(format_.height), crc32(pixels), format_.link});
        FramePieces pieces(header, pixels, cut_, link_->out_packet_bytes());
        ++(send(pieces, queue) ? written : failed);
    }

private:
    bool reopen() noexcept {
        if (!retry_.due()) return false;
        try {
            if (!open()) return false;
        } catch (const std::exception&) {  // out of memory: retried
            return false;
        }
        ++reconnects;
        return true;
    }

    /// Sends the whole frame; false: it was cut short.
    bool send(FramePieces& pieces, const WriteQueue& queue) noexcept {
        went_wrong_ = stalled_ = false;
        t_progress_ns_ = monotonic_ns();
        const auto outs = link_->outs();
        for (;;) {
            for (UsbTransfer& t : outs)
                if (!t.under_way && !pieces.empty() && !went_wrong_) link_->send(t, pieces.next(t.bytes));
            if (went_wrong_ || link_->gone() || queue.time_left_ms() == 0 ||
                monotonic_ns() - t_progress_ns_ > kBridgeTimeout_ns) {
                take_back();
                cut_ = went_wrong_ || !pieces.empty() || !link_;  // not if it ended just then
                return !cut_;
            }
            if (pieces.empty() && !any_under_way()) break;
            link_->serve(kServePeriod_ns);
        }
        cut_ = false;
        return true;
    }

    /// Cancels pending transfers, and makes the bridge ready for the next frame or closes it.
    void take_back() noexcept {
        if (!link_->gone()) {
            link_->cancel_outs();
            for (const std::int64_t until_ns = monotonic_ns() + kBridgeTimeout_ns;
                 any_under_way() && !link_->gone() && monotonic_ns() < until_ns;)
                link_->serve(kServePeriod_ns);
            if (any_under_way() || (stalled_ && !link_->clear_halt_out())) link_->give_up();
        }
        if (!link_->gone()) return;
        link_.reset();
        (void)retry_.due();  // not before a second has passed
    }

    [[nodiscard]] bool any_under_way() const noexcept {
        return std::ranges::any_of(link_->outs(), &UsbTransfer::under_way);
    }

    void received(UsbTransfer&, UsbEnd) noexcept override {}
    void sent(UsbTransfer&, UsbEnd end) noexcept override {
        t_progress_ns_ = monotonic_ns();
        if (end != UsbEnd::whole) went_wrong_ = true;
        if (end == UsbEnd::stalled) stalled_ = true;
    }

    BulkSpec spec_;
    VideoFormat format_;
    std::array<UsbId, 1> own_id_{};
    UsbKind kind_{"USB frame bridge", "bulk:", kBridgeIds,
                  "lsusb   (what the machine sees; of another make: bulk:VENDOR:PRODUCT/)"};
    std::unique_ptr<UsbLink> link_;
    RetryTimer retry_;
    bool cut_ = false, went_wrong_ = false, stalled_ = false;
    std::int64_t t_progress_ns_ = 0;
};

}  // namespace

VideoSinkResult open_bulk_sink(const std::string& text, const VideoSinkOptions& o) {
    auto spec = parse_bulk(text);
    if (!spec) return spec.error();
    if (link_bytes(o.format) > std::numeric_limits<std::uint32_t>::max())
        return Error{"bulk:" + text + ": expected frames below 4 GiB"};
    auto writer = std::make_unique<BulkWriter>(*std::move(spec), o.format);
    if (auto opened = writer->open(); !opened) {
        Error e = opened.error();
        e.what = "bulk:" + text + ": " + e.what;
        return e;
    }
    std::string description = writer->description();
    return queued_sink(std::move(writer), o.format, o.full, std::move(description));
}

Result<std::vector<PluggedUsbDevice>> find_bulk_bridges() {
    return list_usb_devices(kBridgeIds);
}

#else

VideoSinkResult open_bulk_sink(const std::string& text, const VideoSinkOptions&) {
    if (auto spec = parse_bulk(text); !spec) return spec.error();
    return built_without_usb();
}
Result<std::vector<PluggedUsbDevice>> find_bulk_bridges() {
    return built_without_usb();
}

#endif

}  // namespace narpa
