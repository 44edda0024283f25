/// protocols/video/embedded_line.h - the identity and time ledger of a frame, inside the frame.
///
/// The ledger is written as raw bytes at the start of the image's last row; the rest of the row stays image. It
/// survives every lossless path (V4L2 loopback, Y4M, raw files), which carry neither a frame number nor a time
/// of validity of their own. README.md in this folder has the table and a decoder in Python.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "protocols/ledger.h"

namespace narpa {

/// magic, version, size, camera, pose counter, flags, step, budget's kind, command counter | frame, samples per
/// pixel, error | samples, rays, budget | passes | eight times | region, gain, binning, trigger | CRC
inline constexpr std::size_t kEmbeddedLineBytes =
    4 + 8 * 1 + 3 * 4 + 3 * 8 + 4 * FrameLedger::kPasses + 8 * 8 + 12 + 4;  ///< 160
inline constexpr std::uint8_t kEmbeddedLineVersion = 3;

/// Writes the ledger into the first kEmbeddedLineBytes of `row`, the bytes of the last row. False, and nothing
/// written: the row is too narrow.
[[nodiscard]] bool encode_embedded_line(const FrameLedger& ledger, std::span<std::uint8_t> row) noexcept;

/// The ledger's `delivery` is not in the line: a repeated frame still has its own line. Nothing: too narrow, no
/// magic, another version, or a wrong CRC.
[[nodiscard]] std::optional<FrameLedger> decode_embedded_line(std::span<const std::uint8_t> row) noexcept;

}  // namespace narpa
