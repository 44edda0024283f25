/// emulator/log/ledger_log.h - CAMERA.ledger.csv: a row for each frame of a run, written by CameraSensor and read
/// by `narpa replay`.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "base/result.h"
#include "protocols/ledger.h"

namespace narpa {

/// The names of the columns: kLedgerColumns, then image_crc32.
[[nodiscard]] const std::string& ledger_header();

/// CRC-32 of IEEE 802.3 (zlib's and Python's `crc32`) of a frame's bytes as the device takes them, with their
/// embedded line.
[[nodiscard]] std::uint32_t image_crc32(std::span<const std::uint8_t> bytes) noexcept;

/// Writes one row and its line end; every number reads back bit for bit. `crc32` is of the frame's own bytes,
/// whatever was handed over in its place. Returns the bytes used, 0 when `out` is too short (512 are enough).
/// Allocates nothing.
std::size_t format_ledger_row(std::span<char> out, const FrameLedger& ledger, std::uint32_t crc32) noexcept;

struct LoggedFrame {
    FrameLedger ledger;  ///< except the camera's index, which is not in the log
    std::uint32_t image_crc32 = 0;
    int line = 0;  ///< of the log
};
/// Reads the log of one camera. Errors name file, line and column.
Result<std::vector<LoggedFrame>> read_ledger_log(const std::string& path);

}  // namespace narpa
