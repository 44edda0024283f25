// What a USB host sends over USB/IP to the adapter, the camera and the frame bridge in software, transfer after
// transfer, and what an adapter sends to its host. The first byte says which.
#include <algorithm>
#include <vector>

#include "drivers/usb/bridge_device.h"
#include "drivers/usb/gs_usb_device.h"
#include "drivers/usb/usb_control.h"
#include "drivers/usb/uvc_device.h"
#include "protocols/crc32.h"
#include "protocols/usb/gs_usb.h"
#include "protocols/usb/usbip.h"
#include "tests/fuzz/can_frames.h"
#include "tests/fuzz/fuzz.h"

namespace {

using namespace narpa;
using Bytes = std::span<const std::uint8_t>;

/// Transfers as in a connection after an import.
void serve(UsbDevice& device, Bytes bytes) {
    device.plugged(true);
    while (bytes.size() >= kUsbIpHeaderBytes) {
        const auto request = decode_usbip_request(bytes.first<kUsbIpHeaderBytes>());
        if (!fuzz::count(request.has_value())) break;
        bytes = bytes.subspan(kUsbIpHeaderBytes);
        const auto* submit = std::get_if<UsbIpSubmit>(&*request);
        if (submit == nullptr) continue;
        const std::size_t length = std::min<std::size_t>(submit->length, submit->to_host ? 65536 : bytes.size());
        std::vector<std::uint8_t> data(length);
        if (!submit->to_host) {
            std::copy_n(bytes.begin(), length, data.begin());
            bytes = bytes.subspan(length);
        }
        const int n = submit->endpoint == 0 ? usb_control(device, submit->setup, data)
                      : submit->to_host     ? device.give(submit->endpoint, data)
                                            : device.take(submit->endpoint, data);
        const bool is_error = n == UsbAnswer::kStall || n == UsbAnswer::kPending || n == UsbAnswer::kBabble;
        fuzz::require(is_error || (n >= 0 && static_cast<std::size_t>(n) <= length), "no more than was asked for");
    }
    device.plugged(false);
}

/// Every decoder of what a device sends.
void listen(Bytes bytes) {
    for (const bool with_time : {false, true})
        if (const auto f = decode_gs_usb_frame(bytes, with_time); fuzz::count(f.has_value())) {
            fuzz::require(f->frame.error || fuzz::is_valid(f->frame), "a frame is a frame");
            std::array<std::uint8_t, kGsUsbFrameMostBytes> again{};
            const std::size_t n = encode_gs_usb_frame(*f, with_time, again);
            fuzz::require(decode_gs_usb_frame(std::span(again).first(n), with_time).has_value(),
                          "it is read again");
        }
    if (const auto l = decode_gs_usb_limits(bytes))
        for (const std::uint32_t rate : {10'000u, 500'000u, 1'000'000u})
            if (const auto t = bit_timing_of(rate, l->clock_hz, l->nominal))
                fuzz::require(l->clock_hz / t->brp / t->quanta() == rate, "a bit timing is exact");
    (void)decode_gs_usb_config(bytes), (void)decode_gs_usb_bit_timing(bytes), (void)decode_gs_usb_mode(bytes);
    (void)decode_usb_device(bytes), (void)decode_usb_configuration(bytes);
    if (const auto h = decode_bulk_header(bytes))
        fuzz::require(std::ranges::equal(encode_bulk_header(*h), bytes), "a header has one form");
    (void)decode_uvc_probe(bytes), (void)decode_uvc_header(bytes);
    if (bytes.size() >= kUsbIpHeaderBytes) (void)decode_usbip_reply(bytes.first<kUsbIpHeaderBytes>());
    if (bytes.size() >= kUsbIpOpBytes) (void)decode_usbip_op(bytes.first<kUsbIpOpBytes>());
    if (bytes.size() >= kUsbIpBusIdBytes) (void)decode_usbip_bus_id(bytes.first<kUsbIpBusIdBytes>());
}

}  // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    if (size == 0) return 0;
    static GsUsbDevice adapter("FUZZ", true);
    static UvcDevice camera({64, 48, PixelFormat::yuyv, 100'000'000},
                            VideoControls{50'000, 30'000'000, 5'000'000, 2400, 0, false}, "FUZZ");
    const Bytes rest(data + 1, size - 1);
    switch (data[0] % 4) {
        case 0: serve(adapter, rest); break;
        case 1: serve(camera, rest); break;
        case 3: {
            BridgeDevice bridge({16, 8, PixelFormat::grey, 100'000'000}, "FUZZ");
            serve(bridge, rest);
            std::array<std::uint8_t, 16 * 8> pixels{};
            for (BulkFrameHeader h; bridge.receive(pixels, h, 0, [] {});)
                fuzz::require(h.pixels_crc32 == crc32(pixels), "a frame is whole");
            break;
        }
        default: listen(rest);
    }
    for (VideoRequest r; camera.next_request(r);)
        fuzz::require(!r.exposure_ns || (*r.exposure_ns >= 50'000 && *r.exposure_ns <= 30'000'000),
                      "within its limits");
    return 0;
}
