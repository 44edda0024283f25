/// protocols/can/dbc_reader.h - the messages and signals of a DBC file of a user's own bus. (dbc.h writes narpa's.)
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/result.h"

namespace narpa {

/// A signal as the file states it.
struct DbcSignal {
    enum class Kind : std::uint8_t { integer, float32, float64 };

    std::string name{}, unit{};
    std::uint16_t start_bit =
        0;                    ///< little-endian: of the lowest bit; big-endian: of the highest, bits 7 to 0 a byte
    std::uint8_t length = 0;  ///< 1 to 64 bits
    bool big_endian = false, is_signed = false;
    bool multiplexed = false;  ///< only in some frames of its message
    Kind kind = Kind::integer;
    double factor = 1, offset = 0;  ///< physical value = offset + factor * raw value

    /// Of a message's data, which hold the signal.
    [[nodiscard]] double value(std::span<const std::uint8_t> data) const noexcept;
};

struct DbcMessage {
    std::string name;
    std::uint32_t id = 0;
    bool extended = false;  ///< 29-bit identifier
    std::uint8_t size = 0;  ///< bytes
    std::vector<DbcSignal> signals{};
};

/// All messages. Errors have a line and a column: a message or signal that is not written as the format says, or
/// that lies outside of its message. Other statements (comments, attributes, value tables) are passed over. `path`:
/// for the errors.
[[nodiscard]] Result<std::vector<DbcMessage>> read_dbc(std::string_view text, const std::string& path);

}  // namespace narpa
