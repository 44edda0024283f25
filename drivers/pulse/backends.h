/// drivers/pulse/backends.h - the lines behind the rows of the tables in open_pulse.cpp. They get the text after
/// the prefix.
#pragma once

#include "drivers/pulse/pulse_sink.h"
#include "drivers/pulse/pulse_source.h"

namespace narpa {

/// `text`: CHIP/LINE[,active_low][,falling].
Result<std::unique_ptr<PulseSource>> open_gpio_source(const std::string& text);
/// `text`: CHIP/LINE[,active_low].
Result<std::unique_ptr<PulseSink>> open_gpio_sink(const std::string& text);
/// `text`: [ADDRESS[%INTERFACE]:]PORT; each datagram is a pulse, whatever its content.
Result<std::unique_ptr<PulseSource>> open_udp_pulses(const std::string& text);
/// `text`: a serial port's device.
Result<std::unique_ptr<PulseSink>> open_serial_sink(const std::string& text);

}  // namespace narpa
