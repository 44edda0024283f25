/// drivers/video/y4m_writer.h - what the sinks that write Y4M (files, FIFOs, TCP) have in common.
#pragma once

#include <sys/uio.h>

#include <algorithm>
#include <array>
#include <string>
#include <vector>

#include "drivers/video/backends.h"
#include "protocols/video/y4m.h"

namespace narpa {

/// Between two checks of the time left while a reader blocks or is away.
inline constexpr int kPollPeriodMs = 20;

/// What is left to write of a frame: its header, after the stream's header before the first frame, and its samples.
class Y4mPieces {
public:
    void add(std::string_view text) noexcept { add(text.data(), text.size()); }
    void add(std::span<const std::uint8_t> bytes) noexcept { add(bytes.data(), bytes.size()); }
    [[nodiscard]] bool empty() const noexcept { return first_ == last_; }
    /// One writev(), whose result it returns.
    ssize_t write_to(int fd) noexcept {
        const ssize_t n = ::writev(fd, pieces_.data() + first_, static_cast<int>(last_ - first_));
        for (auto left = static_cast<std::size_t>(std::max<ssize_t>(n, 0)); left > 0;) {
            iovec& piece = pieces_[first_];
            const std::size_t part = std::min(left, piece.iov_len);
            piece.iov_base = static_cast<char*>(piece.iov_base) + part;
            piece.iov_len -= part;
            left -= part;
            if (piece.iov_len == 0) ++first_;
        }
        return n;
    }
    /// Copies what is left, so that the frame may be overwritten.
    void move_to(std::vector<std::uint8_t>& bytes) {
        bytes.clear();
        for (; first_ < last_; ++first_) {
            const auto* data = static_cast<const std::uint8_t*>(pieces_[first_].iov_base);
            bytes.insert(bytes.end(), data, data + pieces_[first_].iov_len);
        }
        *this = {};
        add(std::span<const std::uint8_t>(bytes));
    }

private:
    void add(const void* data, std::size_t size) noexcept { pieces_[last_++] = {const_cast<void*>(data), size}; }

    std::array<iovec, 3> pieces_{};
    std::size_t first_ = 0, last_ = 0;
};

class Y4mWriter : public VideoWriter {
public:
    Y4mWriter(const VideoFormat& format, std::string header) : format_(format), header_(std::move(header)) {
        if (!y4m_is_verbatim(format.pixel)) planar_.resize(frame_bytes(format));
    }

protected:
    std::span<const std::uint8_t> samples(std::span<const std::uint8_t> frame) noexcept {
        if (planar_.empty()) return frame;
        y4m_samples(format_, frame, planar_);
        return planar_;
    }
    [[nodiscard]] Y4mPieces pieces(std::span<const std::uint8_t> samples_of_frame,
                                   bool with_stream_header) const noexcept {
        Y4mPieces all;
        if (with_stream_header) all.add(header_);
        all.add(kY4mFrameHeader);
        all.add(samples_of_frame);
        return all;
    }

private:
    VideoFormat format_;
    std::string header_;
    std::vector<std::uint8_t> planar_;
};

}  // namespace narpa
