// narpa-usbcan - a USB-CAN adapter in software (gs_usb, as candleLight), served over USB/IP, with any CAN bus
// behind it.
#include "apps/programs/program.h"
#include "base/stop.h"
#include "base/text/read_number.h"
#include "drivers/can/can_bus.h"
#include "drivers/usb/faulty_device.h"
#include "drivers/usb/gs_usb_device.h"
#include "drivers/usb/usbip_server.h"

namespace narpa {
namespace {

struct UsbCanArguments {
    std::string bus, listen = "3240", serial = "NARPA0001", fault;
    bool is_classic = false, is_client = false;
    int ready_fd = -1;
};

struct WantedFault {
    UsbFault kind = UsbFault::none;
    bool is_bus_off = false, loses_echoes = false;
    std::uint64_t after = 0;
};

Result<WantedFault> parse_fault(std::string_view text) {
    WantedFault f;
    const std::size_t at = text.find('@');
    const std::string_view kind = text.substr(0, at);
    f.kind = kind == "stall"     ? UsbFault::stall
             : kind == "short"   ? UsbFault::shorten
             : kind == "babble"  ? UsbFault::babble
             : kind == "hang"    ? UsbFault::hang
             : kind == "answers" ? UsbFault::answers
                                 : UsbFault::none;
    f.is_bus_off = kind == "bus-off";
    f.loses_echoes = kind == "echoes";
    if ((f.kind == UsbFault::none && !f.is_bus_off && !f.loses_echoes) || at == std::string_view::npos ||
        !read_number(text.substr(at + 1), f.after) || f.after == 0)
        return Error{"--fault " + std::string(text) +
                     ": expected stall@N, short@N, babble@N, hang@N, answers@N, echoes@N or bus-off@N, with N > 0 "
                     "transfers"};
    return f;
}

Status run_usbcan(const UsbCanArguments& a) {
    const auto listen = parse_listen_address(a.listen);
    if (!listen) return listen.error();
    WantedFault fault;
    if (!a.fault.empty()) {
        auto parsed = parse_fault(a.fault);
        if (!parsed) return parsed.error();
        fault = *parsed;
    }
    auto bus = open_can_bus(a.bus, a.is_client ? CanRole::client : CanRole::hub);
    if (!bus) return bus.error();
    if ((*bus)->recorded() || (*bus)->ended()) return Error{a.bus + ": expected a bus, not a log"};
    GsUsbDevice adapter(a.serial, (*bus)->carries_fd() && !a.is_classic);
    if (fault.is_bus_off) adapter.bus_off_after(fault.after);
    if (fault.loses_echoes) adapter.lose_echoes_after(fault.after);
    FaultyDevice faulty(adapter, fault.kind, fault.after);
    auto server = UsbIpServer::start(listen->host, listen->port, faulty);
    if (!server) return server.error();

    stop_on_signals();
    cli::print_error("bus behind the adapter: {}\n", (*bus)->description());
    cli::print_error("gs_usb adapter {} at {}:{}; on the host, as root: usbip --tcp-port {} attach -r HOST -b {}\n",
                     a.serial, listen->host, (*server)->port(), (*server)->port(), UsbIpServer::kBusId);
    notify_ready(a.ready_fd, fmt::format("USBIP={}:{}\n", listen->host, (*server)->port()));
    constexpr std::int64_t kPollPeriod_ns = 100'000'000;
    while (!stop_flag().load(std::memory_order_relaxed))
        if (adapter.turn(**bus, kPollPeriod_ns)) (*server)->wake();
    const UsbIpCounters usb = (*server)->counters();
    server->reset();
    const GsUsbDeviceCounters c = adapter.counters();
    fmt::print(
        "{{\"plugged\": {}, \"transfers\": {}, \"unlinked\": {}, \"refused\": {}, \"from_host\": {}, "
        "\"abandoned\": {}, "
        "\"to_host\": {}, \"overflow\": {}, \"missed\": {}, \"malformed\": {}, \"bus_off\": {}}}\n",
        usb.plugged, usb.transfers, usb.unlinked, usb.refused, c.from_host, c.abandoned, c.to_host, c.overflow,
        c.missed, c.malformed, c.bus_off);
    return Ok{};
}

void add_usbcan_options(UsbCanArguments& a, const cli::Parser& p) {
    p.option("--can", a.bus, "The bus behind the adapter: " + can_bus_help()).type_name("BUS").required();
    p.option("--listen", a.listen, "[ADDRESS:]PORT where hosts find it (default: port 3240 of the loopback)")
        .type_name("PORT");
    p.option("--serial", a.serial, "Its serial number").shows_default();
    p.flag("--classic", a.is_classic, "An adapter without CAN FD");
    p.flag("--client", a.is_client, "Join the bus of `narpa run` (slcan) instead of being its hub");
    p.option("--fault", a.fault,
             "stall|short|babble|hang|answers|echoes|bus-off after N transfers: to try how hosts take it")
        .type_name("KIND@N");
    p.examples(
        {"narpa-usbcan --can vcan0", "sudo usbip attach -r 127.0.0.1 -b 1-1   (then: ip link set can0 up ...)"});
}

}  // namespace
}  // namespace narpa

int main(int argc, char** argv) {
    using namespace narpa;
    UsbCanArguments a;
    return cli::run_program(
        argc, argv,
        {"narpa-usbcan",
         "narpa-usbcan is a USB-CAN adapter in software (gs_usb, as candleLight firmware), served to Linux over "
         "USB/IP. "
         "It ends on a signal and prints its counters as JSON.",
         NARPA_VERSION},
        a.ready_fd, [&](const cli::Parser& p) { add_usbcan_options(a, p); }, [&] { return run_usbcan(a); });
}
