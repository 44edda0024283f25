// The tables of what gives pulses and of what takes them.
#include <array>
#include <span>

#include "drivers/device_kind.h"
#include "drivers/pulse/backends.h"

namespace narpa {
namespace {

struct PulseSourceKind : DeviceKind {
    Result<std::unique_ptr<PulseSource>> (*open)(const std::string& rest);
};
constexpr std::array kPulseSources{
    PulseSourceKind{
        {"gpio:", "gpio:CHIP/LINE", "gpio:CHIP/LINE[,active_low][,falling] (edges, as gpio:gpiochip0/17)"},
        open_gpio_source},
    PulseSourceKind{{"udp:", "udp:PORT", "udp:[ADDRESS[%INTERFACE]:]PORT (datagrams)"}, open_udp_pulses},
};
constexpr std::span<const PulseSourceKind> kPulseSourceTable{kPulseSources};

struct PulseSinkKind : DeviceKind {
    Result<std::unique_ptr<PulseSink>> (*open)(const std::string& rest);
};
constexpr std::array kPulseSinks{
    PulseSinkKind{{"gpio:", "gpio:CHIP/LINE", "gpio:CHIP/LINE[,active_low]"}, open_gpio_sink},
    PulseSinkKind{{"serial:", "serial:DEVICE", "serial:DEVICE (RTS, as serial:/dev/ttyS0)"}, open_serial_sink},
};
constexpr std::span<const PulseSinkKind> kPulseSinkTable{kPulseSinks};

/// Opens what the text names in the table.
template <class Row>
auto open_named(std::span<const Row> table, const std::string& spec) -> decltype(table[0].open(spec)) {
    const Row* kind = find_kind(table, spec);
    if (kind == nullptr) return Error{"pulses \"" + spec + "\": expected " + forms_of(table)};
    auto opened = kind->open(kind->rest_of(spec));
    if (opened) return opened;
    Error error = opened.error();
    error.what = "pulses \"" + spec + "\": " + error.what;
    return error;
}

}  // namespace

Result<std::unique_ptr<PulseSource>> open_pulse_source(const std::string& spec) {
    return open_named(kPulseSourceTable, spec);
}
std::string pulse_source_help() {
    return help_of(kPulseSourceTable);
}
Result<std::unique_ptr<PulseSink>> open_pulse_sink(const std::string& spec) {
    return open_named(kPulseSinkTable, spec);
}
std::string pulse_sink_help() {
    return help_of(kPulseSinkTable);
}

}  // namespace narpa
