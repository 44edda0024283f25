/// drivers/video/v4l2_device.h - what V4L2 sinks and sources have in common.
#pragma once

#include <linux/videodev2.h>

#include <cstdint>
#include <string>

#include "base/pixel_format.h"

namespace narpa {

/// ioctl, again while a signal interrupts it.
int xioctl(int fd, unsigned long request, void* argument) noexcept;

/// The capabilities of this device node; 0 with errno when it is no V4L2 device.
[[nodiscard]] std::uint32_t v4l2_capabilities(int fd) noexcept;

[[nodiscard]] v4l2_pix_format v4l2_wanted_format(const VideoFormat& format) noexcept;
/// For drivers without 16-bit mosaics (v4l2loopback 0.12.7 is one): Y16, with the same bytes. Other formats are
/// unchanged.
[[nodiscard]] v4l2_pix_format v4l2_carrier_format(const VideoFormat& format) noexcept;
/// Size, pixels and bytes a line agree.
[[nodiscard]] bool is_same_format(const v4l2_pix_format& a, const v4l2_pix_format& b) noexcept;
/// "640x480 GREY, 640 bytes a line".
[[nodiscard]] std::string format_text(const v4l2_pix_format& pix);

/// The command that makes a v4l2loopback device of this path.
[[nodiscard]] std::string v4l2loopback_remedy(const std::string& path);

}  // namespace narpa
