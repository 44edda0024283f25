/// protocols/foxglove/ledger_message.h - narpa.FrameLedger: the time ledger of a frame as a Protobuf message. Its
/// fields are the columns of CAMERA.ledger.csv, by name, numbered from 1 in their order.
#pragma once

#include <cstdint>
#include <string_view>
#include <vector>

#include "protocols/ledger.h"

namespace narpa {

inline constexpr std::string_view kLedgerMessage = "narpa.FrameLedger";

/// Appends the message. `image_crc32`: of the frame's bytes, as in the log.
void encode_ledger_message(const FrameLedger& ledger, std::uint32_t image_crc32, std::vector<std::uint8_t>& out);
/// The bytes of its FileDescriptorSet.
[[nodiscard]] std::vector<std::uint8_t> ledger_message_descriptors();

}  // namespace narpa
