// A sink that is a GigE Vision camera for whichever client on the network takes it.
#include "drivers/video/backends.h"
#include "drivers/video/gige_camera.h"

namespace narpa {
namespace {

constexpr const char* kLoopback = "127.0.0.1";

class GigeWriter final : public VideoWriter {
public:
    explicit GigeWriter(std::unique_ptr<GigeCamera> camera) : camera_(std::move(camera)) {}

    void write_frame(std::span<const std::uint8_t> frame, const FrameStamp& stamp,
                     const WriteQueue& queue) noexcept override {
        const auto shown =
            camera_->show(frame, stamp.t_ns, stamp.number, [&queue] { return queue.time_left_ms() == 0; });
        switch (shown) {
            case GigeCamera::Shown::whole: ++written; break;
            case GigeCamera::Shown::no_client: ++no_reader; break;
            case GigeCamera::Shown::timed_out: ++failed; break;
        }
    }

private:
    std::unique_ptr<GigeCamera> camera_;
};

}  // namespace

VideoSinkResult open_gige_sink(const std::string& text, const VideoSinkOptions& o) {
    const std::string address = text.empty() ? kLoopback : text;
    auto camera = GigeCamera::open(address, o.format);
    if (!camera) {
        Error error = camera.error();
        error.what = "gige:" + text + ": " + error.what;
        return error;
    }
    return queued_sink(std::make_unique<GigeWriter>(*std::move(camera)), o.format, o.full,
                       "GigE Vision camera narpa-0001 at " + address);
}

}  // namespace narpa
