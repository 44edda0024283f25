// A candump log: line by line, and as the bus `log:FILE`.
#include "protocols/can/candump.h"

#include <array>

#include "drivers/can/buses.h"
#include "tests/fuzz/can_frames.h"
#include "tests/fuzz/fuzz.h"

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    using namespace narpa;
    fuzz::for_each_line(fuzz::text_of(data, size), [](std::string_view text) {
        CandumpLine line;
        if (!fuzz::count(parse_candump(text, line) == nullptr)) return;
        fuzz::require(fuzz::is_valid(line.frame) && line.t_ns >= 0, "a frame is valid");
        std::array<char, kCandumpMaxLine> again{};
        fuzz::require(format_candump(line, "can0", again) > 0, "a frame can be written again");
    });
    static const fuzz::InputFolder folder;
    const auto bus = open_can_bus("log:" + folder.write("can.log", fuzz::text_of(data, size)), CanRole::hub);
    ReceivedFrame frame;
    while (bus && (*bus)->receive(frame)) fuzz::require(fuzz::is_valid(frame.frame), "a frame of the bus is valid");
    return 0;
}
