// The channels that bench/latency.h measures: buses, sinks of frames, LiDAR packets.
#include <fmt/format.h>
#include <sys/stat.h>

#include <array>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <thread>

#include "base/time.h"
#include "bench/latency.h"
#include "drivers/can/can_bus.h"
#include "drivers/lidar/packet_sink.h"
#include "drivers/lidar/packet_source.h"
#include "drivers/usb/vhci_port.h"
#include "drivers/video/video_sink.h"
#include "drivers/video/video_source.h"
#include "protocols/can/messages.h"
#include "protocols/little_endian.h"

namespace narpa {
namespace {

constexpr std::uint32_t kBody = 0x100;
constexpr std::int64_t kSeen_ns = 60 * kSecond_ns;  // for a kernel to register a device that was plugged in

/// Repeats `open` until the kernel has registered the device.
template <class T>
Result<T> once_it_is_seen(const std::function<Result<T>()>& open, const StopFlag& stop) {
    const std::int64_t until_ns = monotonic_ns() + kSeen_ns;
    for (;;) {
        auto device = open();
        if (device || device.error().kind == ErrorKind::bad_input || monotonic_ns() > until_ns || stop)
            return device;
        std::this_thread::sleep_for(std::chrono::milliseconds(50));
    }
}

// --- Buses -----------------------------------------------------------

Result<LatencyRow> measure_commands(CanBus& hub, const std::string& name, const std::string& peer_spec,
                                    std::unique_ptr<CanBus>& peer, bool fd, const LatencySettings& s,
                                    const StopFlag& stop) {
    PoseDecoder decoder(kBody);
    LatencyEnds ends;
    ends.join = [&]() -> Status {
        if (peer) return Ok{};
        auto opened = open_can_bus(peer_spec, CanRole::client);
        if (!opened) return opened.error();
        peer = *std::move(opened);
        return Ok{};
    };
    ends.send = [&](std::uint32_t k) {
        PoseCommand command;
        command.counter = static_cast<std::uint8_t>(k);
        command.t_valid_ns = std::int64_t{k} * 1000;
        FrameSet frames;
        bool taken = static_cast<bool>(encode(command, kBody, fd, frames));
        for (const CanFrame& f : frames) taken = taken && peer->send(f);
        return taken;
    };
    ends.receive = [&](std::int64_t timeout_ns) -> std::optional<std::uint32_t> {
        const std::int64_t until_ns = monotonic_ns() + timeout_ns;
        for (;;) {
            PoseCommand command;
            for (ReceivedFrame out; hub.receive(out);)
                if (decoder.accept(out.frame, 0, command) == PoseStatus::complete)
                    return static_cast<std::uint32_t>(command.t_valid_ns / 1000);
            const std::int64_t left_ns = until_ns - monotonic_ns();
            if (left_ns <= 0) return std::nullopt;
            hub.wait(left_ns);
        }
    };
    auto row = measure_latency(ends, s, stop);
    if (!row) return row;
    row->what = fd ? "command, one CAN FD frame" : "command, nine classic frames";
    row->by = name;
    return row;
}

// --- Sinks of frames -------------------------------------------------

/// A sink and how its frames are read here.
struct VideoEnds {
    std::unique_ptr<VideoSink> sink;
    std::unique_ptr<VideoSource> source;  ///< null: a file is polled
    std::unique_ptr<VhciPort> plug{};     ///< destroyed first
};

std::uint16_t port_of(const std::string& description) {
    const std::size_t at = description.find("--tcp-port ");
    return static_cast<std::uint16_t>(std::atoi(description.c_str() + at + std::strlen("--tcp-port ")));
}

/// The capture device that uvcvideo has made of narpa's camera.
Result<std::string> usb_camera() {
    std::error_code none;
    for (const auto& entry : std::filesystem::directory_iterator("/sys/class/video4linux", none)) {
        std::string name, index;
        std::getline(std::ifstream(entry.path() / "name"), name);
        std::getline(std::ifstream(entry.path() / "index"), index);
        const std::string device = "/dev/" + entry.path().filename().string();
        if (name.find("narpa camera") != std::string::npos && index == "0" && std::filesystem::exists(device))
            return device;
    }
    return Error{.what = "uvcvideo has not made a video device of the camera", .kind = ErrorKind::missing};
}

Result<VideoEnds> open_video_ends(const std::string& spec, const VideoFormat& format, const StopFlag& stop) {
    using Sink = std::unique_ptr<VideoSink>;
    VideoEnds e;
    const auto attach = [&](const std::string& description) -> Status {
        auto plug = VhciPort::attach(port_of(description));
        if (!plug) return plug.error();
        e.plug = *std::move(plug);
        return Ok{};
    };
    const auto open_source = [&](const std::string& from) -> Status {
        auto source = open_video_source(from, format);
        if (!source) return source.error();
        e.source = *std::move(source);
        return Ok{};
    };
    const bool is_bulk = spec.starts_with("bulk:"), is_uvc = spec.starts_with("uvc:"),
               is_udp = spec.starts_with("udp:") || spec.starts_with("rtp:");
    struct stat info {};
    if (!is_bulk && !is_uvc && !is_udp && !spec.ends_with(".y4m") && ::stat(spec.c_str(), &info) != 0 &&
        !spec.starts_with("/dev/") && ::mkfifo(spec.c_str(), 0600) != 0)
        return Error{.what = std::string("cannot make a FIFO: ") + std::strerror(errno), .file = spec};
    if (is_bulk) {
        if (auto good = open_source("bridge:0"); !good) return good.error();
        if (auto good = attach(e.source->description()); !good) return good.error();
    }
    if (is_udp) {  // before the first datagram
        const std::string address = spec.substr(0, spec.find(','));
        if (auto good = open_source(address.substr(0, 4) + address.substr(address.rfind(':') + 1)); !good)
            return good.error();
    }
    const std::function open_sink = [&] { return open_video_sink(spec, format, WhenFull::wait); };
    auto sink = is_bulk ? once_it_is_seen<Sink>(open_sink, stop) : open_sink();
    if (!sink) return sink.error();
    e.sink = *std::move(sink);
    if (is_bulk || is_udp || spec.ends_with(".y4m")) return e;
    if (!is_uvc) {
        if (auto good = open_source(spec); !good) return good.error();
        return e;
    }
    if (auto good = attach(e.sink->description()); !good) return good.error();
    auto device = once_it_is_seen<std::string>(usb_camera, stop);
    if (!device) return device.error();
    if (auto good = open_source(*device); !good) return good.error();
    return e;
}

}  // namespace

Result<std::vector<LatencyRow>> measure_bus(const std::string& spec, const LatencySettings& s,
                                            const StopFlag& stop) {
    const std::size_t equals = spec.find('=');
    const std::string hub_spec = spec.substr(0, equals);
    auto hub = open_can_bus(hub_spec, CanRole::hub);
    if (!hub) return hub.error();
    std::string peer_spec = equals == std::string::npos ? (*hub)->address().bus : spec.substr(equals + 1);
    if (peer_spec.empty()) peer_spec = hub_spec;
    std::unique_ptr<CanBus> peer;
    std::vector<LatencyRow> rows;
    for (const bool fd : {false, true}) {
        if ((fd && !(*hub)->carries_fd()) || stop) continue;
        auto row = measure_commands(**hub, spec, peer_spec, peer, fd, s, stop);
        if (!row) return Error{.what = row.error().what, .file = spec, .kind = row.error().kind};
        rows.push_back(*std::move(row));
    }
    return rows;
}

Result<LatencyRow> measure_sink(const std::string& spec, const LatencySettings& s, const StopFlag& stop) {
    auto opened = open_video_ends(spec, s.format, stop);
    if (!opened) return opened.error();
    VideoEnds& e = *opened;
    std::vector<std::uint8_t> to_send(frame_bytes(s.format), 0x55), came(frame_bytes(s.format));
    if (came.size() < 4) return Error{"expected frames of four bytes and more"};
    std::uint64_t written = 0;
    LatencyEnds ends;
    ends.send = [&](std::uint32_t k) {
        put_le(to_send.data(), k);
        return e.sink->send(to_send, {.t_ns = k * s.format.period_ns, .number = k});
    };
    ends.receive = [&](std::int64_t timeout_ns) -> std::optional<std::uint32_t> {
        if (e.source) {
            if (!e.source->receive(came, timeout_ns)) return std::nullopt;
            return get_le<std::uint32_t>(came.data());
        }
        const std::int64_t until_ns = monotonic_ns() + timeout_ns;
        while (e.sink->counters().written == written) {
            if (monotonic_ns() > until_ns) return std::nullopt;
            std::this_thread::sleep_for(std::chrono::microseconds(20));
        }
        return static_cast<std::uint32_t>(written++);
    };
    auto row = measure_latency(ends, s, stop);
    if (!row) return Error{.what = row.error().what, .file = spec, .kind = row.error().kind};
    row->what = fmt::format("frame, {} x {} {}", s.format.width, s.format.height, name(s.format.pixel));
    row->by = spec;
    return row;
}

Result<LatencyRow> measure_packets(std::uint16_t port, const LatencySettings& s, const StopFlag& stop) {
    constexpr std::size_t kPacketBytes = 1206;  // of a VLP-16
    const std::string spec = fmt::format("udp:127.0.0.1:{}", port);
    auto source = open_packet_source(fmt::format("udp:{}", port));
    if (!source) return source.error();
    auto sink = open_packet_sink(spec, {}, false);
    if (!sink) return sink.error();
    std::array<std::uint8_t, kPacketBytes> packet{}, came{};
    LatencyEnds ends;
    ends.send = [&](std::uint32_t k) {
        put_le(packet.data(), k);
        return (*sink)->send(PacketKind::data, packet, 0);
    };
    ends.receive = [&](std::int64_t timeout_ns) -> std::optional<std::uint32_t> {
        if ((*source)->receive(came, timeout_ns) != kPacketBytes) return std::nullopt;
        return get_le<std::uint32_t>(came.data());
    };
    auto row = measure_latency(ends, s, stop);
    if (!row) return Error{.what = row.error().what, .file = spec, .kind = row.error().kind};
    row->what = "LiDAR packet, 1206 bytes";
    row->by = spec;
    return row;
}

}  // namespace narpa
