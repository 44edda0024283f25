// Video as a navigation program reads it: a Y4M stream, and the line embedded in a frame.
#include "protocols/video/y4m.h"

#include <vector>

#include "drivers/video/video_source.h"
#include "protocols/video/embedded_line.h"
#include "tests/fuzz/fuzz.h"

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    using namespace narpa;
    static const fuzz::InputFolder folder;
    constexpr VideoFormat kFormat{16, 4, PixelFormat::grey, 100'000'000};
    (void)decode_embedded_line({data, size});
    const auto source = open_video_source(folder.write("m.y4m", fuzz::text_of(data, size)), kFormat);
    std::vector<std::uint8_t> frame(frame_bytes(kFormat));
    while (fuzz::count(source && (*source)->receive(frame, 0))) {
    }
    return 0;
}
