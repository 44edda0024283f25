// The tables of buses, sinks and sources: what names a kind, what an output occupies, what users read of it.
#include "drivers/device_kind.h"

#include <gtest/gtest.h>
#include <sys/stat.h>

#include <filesystem>
#include <fstream>
#include <set>

#include "drivers/can/can_bus.h"
#include "drivers/lidar/packet_sink.h"
#include "drivers/video/video_sink.h"
#include "tests/support/paths.h"
#include "tests/support/read_file.h"
#include "tests/support/temporary_folder.h"

namespace narpa {
namespace {

std::string form_of(const DeviceKind* kind) {
    return kind ? std::string(kind->form) : "nothing";
}

TEST(DeviceKinds, EachTextNamesItsKind) {
    const test::TemporaryFolder folder;
    const std::string fifo = folder / "a.y4m";  // a FIFO, whatever its name
    ASSERT_EQ(::mkfifo(fifo.c_str(), 0600), 0);
    using KindOf = const DeviceKind* (*)(const std::string&);
    const struct {
        KindOf kind_of;
        std::string text, form;
    } cases[] = {
        {can_bus_kind, "vcan0", "an interface (can0, vcan0)"},
        {can_bus_kind, "slcan:29537", "slcan:PORT"},
        {can_bus_kind, "slcan", "nothing"},
        {can_bus_kind, "vcan0+slcan:29537", "BUS+BUS"},
        {can_bus_kind, "memory:loop", "memory:NAME"},
        {can_bus_kind, "", "nothing"},
        {can_bus_kind, "tcp:5000", "nothing"},
        {video_sink_kind, "/dev/video10", "/dev/videoN"},
        {video_sink_kind, "/dev/null", "/dev/videoN"},
        {video_sink_kind, "tcp:5000", "tcp:PORT"},
        {video_sink_kind, "rtp:127.0.0.1:5004", "rtp:HOST:PORT"},
        {video_sink_kind, "gige:", "gige:[ADDRESS]"},
        {video_sink_kind, "b.y4m", "FILE.y4m"},
        {video_sink_kind, fifo, "an existing FIFO"},
        {video_sink_kind, "none", "none"},
        {video_sink_kind, "film.mov", "nothing"},
        {packet_sink_kind, "udp:127.0.0.1:2368", "udp:HOST:PORT"},
        {packet_sink_kind, "can", "can"},
        {packet_sink_kind, "tcp:5000", "nothing"},
    };
    for (const auto& c : cases) EXPECT_EQ(form_of(c.kind_of(c.text)), c.form) << c.text;
    EXPECT_TRUE(can_bus_kind("nonsense")) << "an interface that may come";
    EXPECT_FALSE(can_bus_kind("nonsense")->shown_by("nonsense"));
    EXPECT_TRUE(can_bus_kind("vcan7")->shown_by("vcan7"));
}

TEST(DeviceKinds, OutputsOfOnePlaceAreFound) {
    const auto place = [](const std::string& sink) {
        const DeviceKind* kind = video_sink_kind(sink) ? video_sink_kind(sink) : packet_sink_kind(sink);
        return kind->place_of(sink);
    };
    EXPECT_EQ(place("udp:127.0.0.1:2368"), place("udp:127.0.0.1:2368,ttl=4"));
    EXPECT_EQ(place("rtp:127.0.0.1:5004,sdp=a.sdp"), place("rtp:127.0.0.1:5004,sdp=b.sdp"));
    EXPECT_NE(place("udp:127.0.0.1:2368"), place("udp:127.0.0.1:2369"));
    EXPECT_EQ(place("/tmp/x/../a.y4m"), place("/tmp/a.y4m"));
    EXPECT_NE(place("/tmp/a.y4m"), place("/tmp/a.pcap"));
    for (const char* shared : {"none", "can", "tcp:5000", "uvc:0", "ouster:8080"})
        EXPECT_EQ(place(shared), "") << shared;
}

TEST(DeviceKinds, FilesAreTestedWithoutBeingMade) {
    const test::TemporaryFolder folder;
    EXPECT_TRUE(check_writable(folder / "new/folder/a.y4m"));
    EXPECT_FALSE(std::filesystem::exists(folder / "new"));
    const std::string file = folder / "old.y4m";
    std::ofstream(file) << "content";
    EXPECT_TRUE(check_writable(file));
    EXPECT_EQ(test::read_text(file), "content");
    const Status in_file = check_writable(file + "/a.y4m");
    ASSERT_FALSE(in_file);
    EXPECT_EQ(in_file.error().kind, ErrorKind::missing);
}

/// docs/devices.md, against what --help says of each kind.
TEST(DeviceKinds, TheManualNamesAll) {
    const std::string manual = test::read_text(test::source_path("docs/devices.md"));
    std::size_t kinds = 0;
    for (const std::string& help : {can_bus_help(), video_sink_help(), packet_sink_help()})
        for (std::size_t at = 0; at < help.size(); ++kinds) {
            const std::size_t end = std::min(help.find(" | ", at), help.size());
            std::string word = help.substr(at, help.find(" (", at) < end ? help.find(" (", at) - at : end - at);
            word = word.substr(0, word.find('[')), word = word.substr(0, word.find("HOST"));
            word = word.substr(word.rfind(' ') + 1);  // "a FIFO"
            EXPECT_NE(manual.find(word), std::string::npos) << word << " of " << help;
            at = end + 3;
        }
    EXPECT_EQ(kinds, 7U + 10U + 5U);
}

}  // namespace
}  // namespace narpa
