// A stream of slcan text, as a client sends it.
#include "protocols/can/slcan.h"

#include "tests/fuzz/can_frames.h"
#include "tests/fuzz/fuzz.h"

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    using namespace narpa;
    SlcanLines lines;
    std::span<const char> rest(reinterpret_cast<const char*>(data), size);
    while (lines.next(rest)) {
        fuzz::require(!lines.line().empty() && lines.line().size() <= SlcanLines::kLongest,
                      "a line has 1 to kLongest characters");
        CanFrame frame;
        if (!fuzz::count(decode_slcan(lines.line(), frame))) continue;
        fuzz::require(fuzz::is_valid(frame), "a frame is a frame");
        std::array<char, kSlcanMaxLine> again{};
        fuzz::require(encode_slcan(frame, again) > 0, "a frame can be written again");
    }
    fuzz::require(rest.empty(), "all bytes are used");
    return 0;
}
