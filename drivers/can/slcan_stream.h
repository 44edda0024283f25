/// drivers/can/slcan_stream.h - one end of an slcan connection: lines in, whole lines out, never waiting.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

#include "drivers/descriptor.h"
#include "protocols/can/slcan.h"

namespace narpa {

class SlcanStream {
public:
    SlcanStream() : out_(kOutBytes) {}

    void attach(Descriptor fd) noexcept;
    void close() noexcept { attach(Descriptor{}); }
    [[nodiscard]] int fd() const noexcept { return fd_.get(); }
    explicit operator bool() const noexcept { return static_cast<bool>(fd_); }

    /// Queues a whole line and sends what goes; false, with nothing queued, when the reader has fallen too far
    /// behind.
    [[nodiscard]] bool write(std::string_view line) noexcept;
    /// Sends what is queued, as far as it goes without waiting.
    void flush() noexcept;
    /// Drops the send queue.
    void discard() noexcept { out_begin_ = out_end_ = 0; }
    /// Bytes that `write` would still take.
    [[nodiscard]] std::size_t room() const noexcept { return out_.size() - (out_end_ - out_begin_); }
    [[nodiscard]] bool pending() const noexcept { return out_begin_ != out_end_; }

    /// Reads what is there, at most `kReadBytes`; false when the other end has gone. Then next_line() returns
    /// the lines.
    [[nodiscard]] bool read() noexcept;
    [[nodiscard]] bool next_line(std::string_view& line) noexcept;
    /// Bytes have been read that next_line() has not yet processed.
    [[nodiscard]] bool unread() const noexcept { return !unread_.empty(); }
    /// Lines too long for slcan, since attach.
    [[nodiscard]] std::uint64_t overlong() const noexcept { return lines_.overlong(); }

    static constexpr std::size_t kReadBytes = 4096;

private:
    static constexpr std::size_t kOutBytes = 256 << 10;  // about 9000 of the longest lines

    Descriptor fd_{};
    SlcanLines lines_{};
    std::array<char, kReadBytes> in_{};
    std::span<const char> unread_{};
    std::vector<char> out_;
    std::size_t out_begin_ = 0, out_end_ = 0;
};

}  // namespace narpa
