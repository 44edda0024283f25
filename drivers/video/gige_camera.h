/// drivers/video/gige_camera.h - a GigE Vision camera in software, by Aravis's (LGPL): narpa gives it frames, their
/// times and numbers, and Aravis speaks the protocol.
#pragma once

#include <condition_variable>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <span>
#include <string>

#include "base/pixel_format.h"
#include "base/result.h"

namespace narpa {

class GigeCamera {
public:
    /// `address`: of an interface of this machine, IPv4. Errors: no such interface, its port 3956 is taken, the
    /// format has no code in GigE Vision, or narpa was built without Aravis.
    static Result<std::unique_ptr<GigeCamera>> open(const std::string& address, const VideoFormat& format);
    virtual ~GigeCamera() = default;

    enum class Shown : std::uint8_t { whole, no_client, timed_out };
    /// Hands over a frame as its link has it, and waits until the camera has copied it. `give_up` is called every
    /// 20 ms.
    [[nodiscard]] virtual Shown show(std::span<const std::uint8_t> frame, std::int64_t t_ns, std::uint32_t number,
                                     const std::function<bool()>& give_up) noexcept = 0;
};

}  // namespace narpa
