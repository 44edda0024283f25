/// protocols/video/frame_cut.h - how a frame is cut for datagrams: each holds whole rows, or a part of one row.
#pragma once

#include <cstddef>
#include <cstdint>

namespace narpa {

/// Headers of IPv4 and UDP.
inline constexpr std::size_t kIpUdpBytes = 20 + 8;

/// What is cut. Rows have no padding.
struct FrameRows {
    std::size_t row_bytes, rows;
    std::size_t unit_bytes;            ///< a part of a row is a multiple of it, its last part excepted
    std::size_t row_header_bytes = 0;  ///< a header in the datagram of each row or part of a row
};

class FrameCut {
public:
    struct Part {
        std::uint32_t row, byte_in_row;
        std::size_t begin, bytes;  ///< in the frame
    };
    /// `bytes_most`: of a datagram, for bytes of the frame and headers of rows; at least a unit and a header.
    FrameCut(const FrameRows& frame, std::size_t bytes_most);

    [[nodiscard]] std::uint32_t count() const noexcept { return parts_; }
    [[nodiscard]] Part operator[](std::uint32_t index) const noexcept;

private:
    std::size_t row_bytes_, rows_;
    std::size_t rows_each_ = 1;     ///< whole rows in a datagram
    std::size_t parts_of_row_ = 1;  ///< datagrams of a row
    std::size_t part_bytes_;        ///< of a part of a row
    std::uint32_t parts_;
};

}  // namespace narpa
