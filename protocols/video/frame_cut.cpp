#include "protocols/video/frame_cut.h"

#include <algorithm>
#include <cassert>

namespace narpa {

FrameCut::FrameCut(const FrameRows& frame, std::size_t bytes_most)
    : row_bytes_(frame.row_bytes), rows_(frame.rows), part_bytes_(row_bytes_) {
    const std::size_t unit = frame.unit_bytes, header = frame.row_header_bytes;
    assert(bytes_most >= header + unit);
    if (row_bytes_ + header <= bytes_most) {
        rows_each_ = std::min(bytes_most / (row_bytes_ + header), rows_);
    } else {
        const std::size_t units = (row_bytes_ + unit - 1) / unit, units_most = (bytes_most - header) / unit;
        parts_of_row_ = (units + units_most - 1) / units_most;
        part_bytes_ = (units + parts_of_row_ - 1) / parts_of_row_ * unit;
        parts_of_row_ = (row_bytes_ + part_bytes_ - 1) / part_bytes_;
    }
    parts_ = static_cast<std::uint32_t>((rows_ + rows_each_ - 1) / rows_each_ * parts_of_row_);
}

FrameCut::Part FrameCut::operator[](std::uint32_t index) const noexcept {
    const std::size_t row = index / parts_of_row_ * rows_each_, byte = index % parts_of_row_ * part_bytes_;
    const std::size_t bytes = parts_of_row_ > 1 ? std::min(part_bytes_, row_bytes_ - byte)
                                                : row_bytes_ * std::min(rows_each_, rows_ - row);
    return {static_cast<std::uint32_t>(row), static_cast<std::uint32_t>(byte), row * row_bytes_ + byte, bytes};
}

}  // namespace narpa
