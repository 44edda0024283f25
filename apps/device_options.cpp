#include "apps/device_options.h"

#include "apps/cli.h"
#include "drivers/can/can_bus.h"
#include "drivers/lidar/packet_sink.h"
#include "drivers/video/video_sink.h"

namespace narpa::cli {
namespace {

Result<DeviceOptions::Outputs> split(const std::vector<std::string>& texts, std::string_view expected) {
    DeviceOptions::Outputs out;
    for (const std::string& text : texts) {
        auto pair = split_pair(text, expected);
        if (!pair) return pair.error();
        out.push_back(*std::move(pair));
    }
    return out;
}

}  // namespace

void DeviceOptions::add_to(Parser c) {
    c.option("--can", bus, can_bus_help()).type_name("BUS").joined_by('+');
    c.option("--video", video_texts, video_sink_help() + "; may be given many times")
        .type_name("CAMERA=SINK")
        .repeatable();
    c.option("--lidar", lidar_texts, packet_sink_help() + "; may be given many times")
        .type_name("LIDAR=SINK")
        .repeatable();
}

Option add_mcap_to(Parser c, std::string& file) {
    return c
        .option(
            "--mcap", file,
            "Also write an MCAP file that Foxglove opens: images, calibrations, point clouds, transforms, ledgers, "
            "estimates")
        .type_name("FILE.mcap");
}

Result<DeviceOptions::Outputs> DeviceOptions::video() const {
    return split(video_texts, "CAMERA=SINK, like nav=/dev/video10");
}
Result<DeviceOptions::Outputs> DeviceOptions::lidar() const {
    return split(lidar_texts, "LIDAR=SINK, like top=udp:127.0.0.1:2368");
}

}  // namespace narpa::cli
