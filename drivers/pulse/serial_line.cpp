// The line RTS of a serial port as an output.
#include <fcntl.h>
#include <sys/ioctl.h>
#include <termios.h>

#include <cerrno>
#include <cstring>

#include "drivers/descriptor.h"
#include "drivers/pulse/backends.h"

namespace narpa {
namespace {

class SerialSink final : public PulseSink {
public:
    SerialSink(std::string device, Descriptor fd) : device_(std::move(device)), fd_(std::move(fd)) {}
    [[nodiscard]] bool set(bool high) noexcept override {
        const int line = TIOCM_RTS;
        return ::ioctl(fd_.get(), high ? TIOCMBIS : TIOCMBIC, &line) == 0;
    }
    [[nodiscard]] std::string description() const override { return "RTS of " + device_; }

private:
    std::string device_;
    Descriptor fd_;
};

}  // namespace

Result<std::unique_ptr<PulseSink>> open_serial_sink(const std::string& text) {
    if (text.empty()) return Error{"expected serial:DEVICE, as serial:/dev/ttyS0"};
    Descriptor fd(::open(text.c_str(), O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC));
    const auto failed = [&](const std::string& what) {
        return Error{.what = what + ": " + std::strerror(errno), .kind = ErrorKind::missing};
    };
    if (!fd) return failed("cannot open " + text);
    // By its own flow control the driver would set the line.
    termios settings{};
    if (::tcgetattr(fd.get(), &settings) == 0) {
        settings.c_cflag &= ~static_cast<tcflag_t>(CRTSCTS);
        ::tcsetattr(fd.get(), TCSANOW, &settings);
    }
    auto sink = std::make_unique<SerialSink>(text, std::move(fd));
    if (!sink->set(false)) return failed(text + " has no line RTS");
    return std::unique_ptr<PulseSink>(std::move(sink));
}

}  // namespace narpa
