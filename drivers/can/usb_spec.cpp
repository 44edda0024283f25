#include "drivers/can/usb_spec.h"

#include <algorithm>

#include "base/text/read_number.h"
#include "drivers/usb/usb_devices.h"

namespace narpa {
namespace {

constexpr std::uint32_t kSlowest = 10'000, kFastest = 1'000'000, kFastestData = 15'000'000;

bool is_rate(std::string_view text, std::uint32_t fastest, std::uint32_t& rate) {
    return read_number(text, rate) && rate >= kSlowest && rate <= fastest;
}

}  // namespace

Result<UsbCanSpec> parse_usb_can(std::string_view text) {
    UsbCanSpec spec;
    const Error expected{"usb:" + std::string(text) +
                         ": expected usb:[ADAPTER][/CHANNEL][@BIT_RATE[,DATA_BIT_RATE]], such as usb: or "
                         "usb:NARPA0001/0@500000,2000000 (10000 to 1000000 bit/s, data to 15000000)"};
    std::string_view name = text;
    if (const std::size_t at = name.rfind('@'); at != std::string_view::npos) {
        const std::string_view rates = name.substr(at + 1);
        const std::size_t comma = rates.find(',');
        if (!is_rate(rates.substr(0, comma), kFastest, spec.bit_rate)) return expected;
        if (comma == std::string_view::npos)
            spec.data_bit_rate = std::max(spec.data_bit_rate, spec.bit_rate);
        else if (!is_rate(rates.substr(comma + 1), kFastestData, spec.data_bit_rate) ||
                 spec.data_bit_rate < spec.bit_rate)
            return expected;
        name = name.substr(0, at);
    }
    if (const std::size_t slash = name.rfind('/'); slash != std::string_view::npos) {
        if (!read_number(name.substr(slash + 1), spec.channel)) return expected;
        name = name.substr(0, slash);
    }
    if (!is_usb_name(name)) return expected;
    spec.adapter = name;
    return spec;
}

}  // namespace narpa
