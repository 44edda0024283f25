/// drivers/pulse/pulse_sink.h - a line that narpa drives, for one pulse per second (PPS): GPIO, or RTS of a serial
/// port.
#pragma once

#include <memory>
#include <string>
#include <string_view>

#include "base/result.h"

namespace narpa {

class PulseSink {
public:
    virtual ~PulseSink() = default;
    PulseSink() = default;
    PulseSink(const PulseSink&) = delete;
    PulseSink& operator=(const PulseSink&) = delete;

    /// Drives the line high or low, by its logical value. False: the device is gone.
    [[nodiscard]] virtual bool set(bool high) noexcept = 0;
    [[nodiscard]] virtual std::string description() const = 0;
};

/// `spec`: one of pulse_sink_help(). The line is low at first.
[[nodiscard]] Result<std::unique_ptr<PulseSink>> open_pulse_sink(const std::string& spec);
[[nodiscard]] std::string pulse_sink_help();

}  // namespace narpa
