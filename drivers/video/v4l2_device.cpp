#include "drivers/video/v4l2_device.h"

#include <sys/ioctl.h>

#include <algorithm>
#include <cerrno>
#include <string_view>

namespace narpa {
namespace {

constexpr std::uint32_t kBigEndianFourcc = 1u << 31;  // v4l2_fourcc_be

std::uint32_t fourcc(const VideoFormat& format) noexcept {
    const std::string text = link_code(format.pixel, format.link);
    std::uint32_t code = 0;
    for (int i = 0; i < 4; ++i)
        code |= std::uint32_t{static_cast<std::uint8_t>(text[static_cast<std::size_t>(i)])} << (8 * i);
    return code;
}

// The number in /dev/videoN, or 10.
std::string video_number(const std::string& path) {
    constexpr std::string_view prefix = "/dev/video";
    const std::string number = path.starts_with(prefix) ? path.substr(prefix.size()) : "";
    return number.empty() || !std::ranges::all_of(number, [](char c) { return c >= '0' && c <= '9'; }) ? "10"
                                                                                                       : number;
}

}  // namespace

int xioctl(int fd, unsigned long request, void* argument) noexcept {
    int result = 0;
    do result = ::ioctl(fd, request, argument);
    while (result < 0 && errno == EINTR);
    return result;
}

std::uint32_t v4l2_capabilities(int fd) noexcept {
    v4l2_capability c{};
    if (xioctl(fd, VIDIOC_QUERYCAP, &c) < 0) return 0;
    return c.capabilities & V4L2_CAP_DEVICE_CAPS ? c.device_caps : c.capabilities;
}

v4l2_pix_format v4l2_wanted_format(const VideoFormat& format) noexcept {
    v4l2_pix_format pix{};
    pix.width = static_cast<std::uint32_t>(format.width);
    pix.height = static_cast<std::uint32_t>(format.height);
    pix.pixelformat = fourcc(format);
    pix.field = V4L2_FIELD_NONE;
    pix.bytesperline = static_cast<std::uint32_t>(link_row_bytes(format));
    pix.sizeimage = static_cast<std::uint32_t>(link_bytes(format));
    pix.colorspace = format.pixel == PixelFormat::yuyv ? V4L2_COLORSPACE_SMPTE170M : V4L2_COLORSPACE_SRGB;
    return pix;
}

v4l2_pix_format v4l2_carrier_format(const VideoFormat& format) noexcept {
    VideoFormat carrier = format;
    if (is_bayer(format.pixel) && is_16_bit(format.pixel) && format.link.is_samples())
        carrier.pixel = PixelFormat::y16;
    return v4l2_wanted_format(carrier);
}

bool is_same_format(const v4l2_pix_format& a, const v4l2_pix_format& b) noexcept {
    return a.width == b.width && a.height == b.height && a.pixelformat == b.pixelformat &&
           a.bytesperline == b.bytesperline;
}

std::string format_text(const v4l2_pix_format& pix) {
    std::string text;
    for (int i = 0; i < 4; ++i) text += static_cast<char>(pix.pixelformat >> (8 * i) & 0x7F);
    if ((pix.pixelformat & kBigEndianFourcc) != 0) text += "-BE";
    return std::to_string(pix.width) + "x" + std::to_string(pix.height) + " " + text + ", " +
           std::to_string(pix.bytesperline) + " bytes a line";
}

std::string v4l2loopback_remedy(const std::string& path) {
    return "sudo modprobe v4l2loopback video_nr=" + video_number(path) + " exclusive_caps=1 max_buffers=8";
}

}  // namespace narpa
