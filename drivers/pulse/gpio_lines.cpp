// Lines of a GPIO chip by the kernel's character device, version 2 of its interface (linux/gpio.h, Linux 5.10).
#include <fcntl.h>
#include <linux/gpio.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <cerrno>
#include <charconv>
#include <cstring>
#include <vector>

#include "drivers/descriptor.h"
#include "drivers/pulse/backends.h"

namespace narpa {
namespace {

struct GpioLine {
    std::string chip;  ///< "/dev/gpiochip0"
    std::uint32_t line = 0;
    bool active_low = false, falling = false;

    [[nodiscard]] std::string text() const { return chip + ", line " + std::to_string(line); }
};

Result<GpioLine> parse_gpio(const std::string& text, bool is_source) {
    const Error wrong{"expected gpio:CHIP/LINE" +
                      std::string(is_source ? "[,active_low][,falling]" : "[,active_low]") +
                      ", as gpio:gpiochip0/17"};
    std::vector<std::string> words;
    for (std::size_t begin = 0; begin <= text.size();) {
        const std::size_t end = std::min(text.find(',', begin), text.size());
        words.push_back(text.substr(begin, end - begin));
        begin = end + 1;
    }
    GpioLine out;
    for (std::size_t i = 1; i < words.size(); ++i) {
        if (words[i] == "active_low")
            out.active_low = true;
        else if (words[i] == "falling" && is_source)
            out.falling = true;
        else
            return wrong;
    }
    const std::size_t slash = words[0].rfind('/');
    if (slash == std::string::npos || slash == 0) return wrong;
    out.chip = words[0].substr(0, slash);
    if (out.chip.find('/') == std::string::npos) out.chip = "/dev/" + out.chip;
    const char *begin = words[0].data() + slash + 1, *end = words[0].data() + words[0].size();
    const auto [stopped, error] = std::from_chars(begin, end, out.line);
    if (error != std::errc() || stopped != end) return wrong;
    return out;
}

/// The line's own descriptor.
Result<Descriptor> request(const GpioLine& line, std::uint64_t flags) {
    const Descriptor chip(::open(line.chip.c_str(), O_RDWR | O_CLOEXEC));
    const auto failed = [&](const char* what) {
        return Error{.what = what + line.text() + ": " + std::strerror(errno),
                     .kind = ErrorKind::missing,
                     .remedy = "gpioinfo   (the lines and who uses them; package gpiod)"};
    };
    if (!chip) return failed("cannot open ");
    gpio_v2_line_request wanted{};
    wanted.offsets[0] = line.line;
    wanted.num_lines = 1;
    std::strncpy(wanted.consumer, "narpa", sizeof wanted.consumer - 1);
    wanted.config.flags = flags | (line.active_low ? GPIO_V2_LINE_FLAG_ACTIVE_LOW : 0);
    if (::ioctl(chip.get(), GPIO_V2_GET_LINE_IOCTL, &wanted) != 0) return failed("cannot use ");
    return Descriptor(wanted.fd);
}

class GpioSource final : public PulseSource {
public:
    GpioSource(GpioLine line, Descriptor fd) : line_(std::move(line)), fd_(std::move(fd)) {
        ::fcntl(fd_.get(), F_SETFL, ::fcntl(fd_.get(), F_GETFL) | O_NONBLOCK);
    }
    [[nodiscard]] std::optional<std::int64_t> receive() noexcept override {
        gpio_v2_line_event event{};
        if (::read(fd_.get(), &event, sizeof event) != sizeof event) return std::nullopt;
        ++counters_.received;
        counters_.lost += event.line_seqno - last_ - 1;  // numbered from 1
        last_ = event.line_seqno;
        return static_cast<std::int64_t>(event.timestamp_ns);
    }
    [[nodiscard]] std::string description() const override {
        return std::string(line_.falling ? "falling" : "rising") + " edges of " + line_.text();
    }

private:
    GpioLine line_;
    Descriptor fd_;
    std::uint32_t last_ = 0;
};

class GpioSink final : public PulseSink {
public:
    GpioSink(GpioLine line, Descriptor fd) : line_(std::move(line)), fd_(std::move(fd)) {}
    [[nodiscard]] bool set(bool high) noexcept override {
        gpio_v2_line_values values{.bits = high ? 1u : 0u, .mask = 1};
        return ::ioctl(fd_.get(), GPIO_V2_LINE_SET_VALUES_IOCTL, &values) == 0;
    }
    [[nodiscard]] std::string description() const override { return line_.text(); }

private:
    GpioLine line_;
    Descriptor fd_;
};

}  // namespace

Result<std::unique_ptr<PulseSource>> open_gpio_source(const std::string& text) {
    auto line = parse_gpio(text, true);
    if (!line) return line.error();
    auto fd = request(*line, GPIO_V2_LINE_FLAG_INPUT |
                                 (line->falling ? GPIO_V2_LINE_FLAG_EDGE_FALLING : GPIO_V2_LINE_FLAG_EDGE_RISING));
    if (!fd) return fd.error();
    return std::unique_ptr<PulseSource>(std::make_unique<GpioSource>(*std::move(line), *std::move(fd)));
}

Result<std::unique_ptr<PulseSink>> open_gpio_sink(const std::string& text) {
    auto line = parse_gpio(text, false);
    if (!line) return line.error();
    auto fd = request(*line, GPIO_V2_LINE_FLAG_OUTPUT);
    if (!fd) return fd.error();
    return std::unique_ptr<PulseSink>(std::make_unique<GpioSink>(*std::move(line), *std::move(fd)));
}

}  // namespace narpa
