/// drivers/video/bulk_bridges.h - the frame bridges (FPGA, FX3) that are plugged in.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/result.h"
#include "drivers/usb/usb_devices.h"

namespace narpa {

struct BulkSpec {
    std::optional<UsbId> id{};  ///< absent: the known bridges
    std::string device{};       ///< serial number, or the port path (1-4.2); empty: the only one
};
/// Parses the text after `bulk:`, [VENDOR:PRODUCT/][SERIAL|BUS-PORT]; ids are hexadecimal.
Result<BulkSpec> parse_bulk(std::string_view text);

/// Error: built without libusb, or a machine without USB.
Result<std::vector<PluggedUsbDevice>> find_bulk_bridges();

}  // namespace narpa
