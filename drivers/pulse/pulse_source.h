/// drivers/pulse/pulse_source.h - pulses that trigger exposures: edges of a GPIO line, or UDP datagrams.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "base/result.h"

namespace narpa {

class PulseSource {
public:
    struct Counters {
        std::uint64_t received = 0;
        std::uint64_t lost = 0;  ///< came, but the kernel's queue was full
    };

    virtual ~PulseSource() = default;
    PulseSource() = default;
    PulseSource(const PulseSource&) = delete;
    PulseSource& operator=(const PulseSource&) = delete;

    /// When the next waiting pulse came, by the kernel's stamp, ns of CLOCK_MONOTONIC. Does not wait; no value:
    /// none has come.
    [[nodiscard]] virtual std::optional<std::int64_t> receive() noexcept = 0;
    [[nodiscard]] virtual std::string description() const = 0;
    [[nodiscard]] const Counters& counters() const noexcept { return counters_; }

protected:
    Counters counters_{};
};

/// `spec`: one of pulse_source_help().
[[nodiscard]] Result<std::unique_ptr<PulseSource>> open_pulse_source(const std::string& spec);
[[nodiscard]] std::string pulse_source_help();

}  // namespace narpa
