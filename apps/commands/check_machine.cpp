#include "apps/commands/check_machine.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <filesystem>

#include "apps/cli.h"
#include "base/write_file.h"
#include "drivers/can/can_bus.h"
#include "drivers/can/usb_adapters.h"
#include "drivers/lidar/packet_sink.h"
#include "drivers/video/bulk_bridges.h"
#include "drivers/video/video_sink.h"
#include "emulator/lidar/lidar_sensor.h"
#include "emulator/ptp4l_watch.h"
#include "emulator/system_utc.h"
#include "protocols/lidar/lidar_model.h"

namespace narpa::cli {
namespace {

Finding socketcan() {
    const int fd = ::socket(PF_CAN, SOCK_RAW, 1);  // CAN_RAW
    if (fd < 0)
        return {"SocketCAN", false, std::strerror(errno),
                "sudo modprobe can_raw (or use --can slcan:29537, which needs no kernel support)"};
    ::close(fd);
    return {"SocketCAN", true, "the kernel has it", ""};
}

Finding video_devices() {
    std::string found;
    std::error_code error;
    for (const auto& entry : std::filesystem::directory_iterator("/dev", error)) {
        const std::string name = entry.path().filename().string();
        if (name.starts_with("video")) found += (found.empty() ? "/dev/" : " /dev/") + name;
    }
    if (found.empty())
        return {
            "V4L2 devices", false, "no /dev/video*",
            "sudo modprobe v4l2loopback video_nr=10 exclusive_caps=1 max_buffers=8 (or --video CAMERA=FILE.y4m)"};
    return {"V4L2 devices", true, found, ""};
}

/// `prefix`: of the option's value for such a device, such as "usb:".
Finding usb_devices(const std::string& name, std::string_view prefix,
                    const Result<std::vector<PluggedUsbDevice>>& devices) {
    if (!devices) return {name, false, devices.error().what, devices.error().remedy};
    if (devices->empty()) return {name, false, "none is plugged in", ""};
    Finding f{name, true, "", ""};
    for (const PluggedUsbDevice& a : *devices) {
        f.detail += fmt::format("{}{}{} at {}{}", f.detail.empty() ? "" : ", ", prefix, a.name(), a.place,
                                a.trouble.empty() ? "" : " (" + a.trouble + ")");
        if (a.trouble.empty()) continue;
        f.there = false;
        f.remedy = usb_permission_remedy();
    }
    return f;
}

/// A resource limit of this process; root is not limited. `item`: its name and value in limits.conf.
Finding permission(std::string name, int resource, rlim_t needed, std::string_view what, std::string_view without,
                   std::string_view item) {
    rlimit limit{};
    ::getrlimit(static_cast<__rlimit_resource_t>(resource), &limit);
    if (::geteuid() == 0 || limit.rlim_cur >= needed)
        return {std::move(name), true, fmt::format("{} is permitted", what), ""};
    const char* user = ::getenv("USER");
    return {std::move(name), false, fmt::format(fmt::runtime(without), limit.rlim_cur / 1024),
            fmt::format("echo \"{} - {}\" | sudo tee -a /etc/security/limits.d/narpa.conf, then log in again",
                        user ? user : "USER", item)};
}

/// The finding for a device that cannot be opened, without the device's name in the error text.
Finding absent(const std::string& spec, const Error& e) {
    const std::string name = spec == "usb:" || spec == "bulk:" ? spec.substr(0, spec.size() - 1) : spec;  // any
    return {name, false, e.what.starts_with(spec + ": ") ? e.what.substr(spec.size() + 2) : e.what, e.remedy};
}

/// What was wrong, if not with what the user wrote.
Result<Finding> finding_of(const std::string& spec, const Error& error) {
    if (error.kind == ErrorKind::bad_input) return error;
    return absent(spec, error);
}
Result<Finding> test_file(const std::string& spec, const Status& writable) {
    return writable ? Finding{spec, true, "can be written", ""} : finding_of(spec, writable.error());
}
/// `open`: as a run would.
Result<Finding> test_device(const std::string& spec, const auto& open) {
    const auto device = open();
    return device ? Finding{spec, true, (*device)->description(), ""} : finding_of(spec, device.error());
}
bool is_new_file(const DeviceKind* kind) {
    return kind && kind->destination == Destination::new_file;
}
Result<Finding> test_bus(const std::string& spec) {
    return test_device(spec, [&] { return open_can_bus(spec, CanRole::hub); });
}
Result<Finding> test_video(const std::string& spec, const VideoFormat& format) {
    if (is_new_file(video_sink_kind(spec))) return test_file(spec, check_video_file(spec, format));
    return test_device(spec, [&] { return open_video_sink(spec, format, WhenFull::drop); });
}
Result<Finding> test_lidar(const std::string& spec, const Lidar& lidar, bool has_bus, const Scene& scene) {
    const DeviceKind* kind = packet_sink_kind(spec);
    if (kind && kind->destination == Destination::bus) {
        if (auto good = check_beams_on_can(lidar, has_bus, scene.file); !good) return good.error();
        return Finding{spec, true, "each shot of LiDAR " + lidar.name + " on the CAN bus", ""};
    }
    if (is_new_file(kind)) return test_file(spec, check_writable(spec));
    return test_device(
        spec, [&] { return open_packet_sink(spec, lidar.model->spec().network, false, lidar.model->metadata()); });
}

/// A device without an option: the text alone shows what it is.
Result<Finding> test_positional(const std::string& spec) {
    const auto shown = [&](const DeviceKind* kind) { return kind && kind->shown_by(spec); };
    const bool bus = shown(can_bus_kind(spec)), video = shown(video_sink_kind(spec)),
               lidar = shown(packet_sink_kind(spec));
    if (bus && !video && !lidar) return test_bus(spec);
    if (video && !bus && !lidar) return test_video(spec, {640, 480, PixelFormat::grey, 100'000'000});
    if (!bus && !video && !lidar)
        return Error{
            "is neither a CAN bus nor a video device, expected what --can or --video of `narpa check --help` shows",
            spec};
    const std::string can_option = "--can " + spec, video_option = "--video CAMERA=" + spec,
                      lidar_option = "--lidar LIDAR=" + spec;
    std::vector<std::string_view> options;
    if (bus) options.push_back(can_option);
    if (video) options.push_back(video_option);
    if (lidar) options.push_back(lidar_option);
    return Error{"needs the option that says what it is, expected " + list_of(options), spec};
}

}  // namespace

std::vector<Finding> general_findings() {
    return {socketcan(),
            usb_devices("USB-CAN adapters", "usb:", find_usb_adapters()),
            video_devices(),
            usb_devices("USB frame bridges", "bulk:", find_bulk_bridges()),

            permission("real-time priority", RLIMIT_RTPRIO, 60, "SCHED_FIFO",
                       "SCHED_FIFO is not permitted: deadlines may slip under load", "rtprio 90"),
            permission("locked memory", RLIMIT_MEMLOCK, RLIM_INFINITY, "mlockall",
                       "limit {} KiB: page faults may cost deadlines", "memlock unlimited")};
}

std::vector<Finding> clock_findings(const TimeSettings& time) {
    if (time.source != TimeSettings::Source::system) return {};
    const ClockDiscipline d = read_clock_discipline();
    Finding clock{"system's clock", d.synchronised, "", ""};
    if (d.synchronised) {
        clock.detail =
            "synchronised, " + error_text(d.error_ns) +
            fmt::format(", frequency corrected by {:+.3f} ppm", 1e-3 * static_cast<double>(d.frequency_ppb));
    } else {
        clock.detail = "not synchronised: UTC is as it was set";
        clock.remedy = "ptp4l with phc2sys, chrony or ntpd";
    }
    const Ptp4lReport ptp4l = read_ptp4l(time.ptp4l, static_cast<std::uint8_t>(time.ptp4l_domain));
    return {clock, {"ptp4l", ptp4l.last.result == Ptp4lReading::Result::answered, to_text(ptp4l), ""}};
}

Status test_devices(const std::vector<std::string>& devices, const DeviceOptions& named, const Scene& scene,
                    std::vector<Finding>& findings) {
    const auto add = [&](Result<Finding> finding) -> Status {
        if (!finding) return finding.error();
        findings.push_back(*std::move(finding));
        return Ok{};
    };
    const auto video = named.video(), lidar = named.lidar();
    if (!video) return video.error();
    if (!lidar) return lidar.error();
    for (const std::string& spec : devices)
        if (auto good = add(test_positional(spec)); !good) return good;
    if (!named.bus.empty())
        if (auto good = add(test_bus(named.bus)); !good) return good;
    for (const auto& [name, spec] : *video) {
        const auto index = sensor_named(scene.cameras, name, "camera", scene.file);
        if (!index) return index.error();
        const Camera& c = scene.cameras[*index];
        if (auto good = add(test_video(spec, c.video_format())); !good) return good;
    }
    for (const auto& [name, spec] : *lidar) {
        const auto index = sensor_named(scene.lidars, name, "LiDAR", scene.file);
        if (!index) return index.error();
        if (auto good = add(test_lidar(spec, scene.lidars[*index], !named.bus.empty(), scene)); !good) return good;
    }
    return Ok{};
}

}  // namespace narpa::cli
