#include "drivers/can/slcan_stream.h"

#include <sys/socket.h>

#include <cerrno>
#include <cstring>

namespace narpa {
namespace {

/// A pseudo-terminal takes only write(); a socket needs send() lest a lost peer raises SIGPIPE.
ssize_t put(int fd, const char* data, std::size_t n) noexcept {
    const ssize_t sent = ::send(fd, data, n, MSG_NOSIGNAL | MSG_DONTWAIT);
    return sent < 0 && errno == ENOTSOCK ? ::write(fd, data, n) : sent;
}

}  // namespace

void SlcanStream::attach(Descriptor fd) noexcept {
    fd_ = std::move(fd);
    lines_ = {};
    unread_ = {};
    discard();
}

bool SlcanStream::write(std::string_view line) noexcept {
    if (out_end_ + line.size() > out_.size() && out_begin_ > 0) {
        flush();
        std::memmove(out_.data(), out_.data() + out_begin_, out_end_ - out_begin_);
        out_end_ -= out_begin_;
        out_begin_ = 0;
    }
    if (out_end_ + line.size() > out_.size()) return false;
    std::memcpy(out_.data() + out_end_, line.data(), line.size());
    out_end_ += line.size();
    flush();
    return true;
}

void SlcanStream::flush() noexcept {
    while (fd_ && pending()) {
        const ssize_t n = put(fd_.get(), out_.data() + out_begin_, out_end_ - out_begin_);
        if (n < 0 && errno == EINTR) continue;
        if (n <= 0) return;  // full: later; gone: read() finds out
        out_begin_ += static_cast<std::size_t>(n);
    }
    discard();
}

bool SlcanStream::read() noexcept {
    ssize_t n = 0;
    do {
        n = ::read(fd_.get(), in_.data(), in_.size());
    } while (n < 0 && errno == EINTR);
    unread_ = {in_.data(), n > 0 ? static_cast<std::size_t>(n) : 0};
    return n > 0 || (n < 0 && errno == EAGAIN);
}

bool SlcanStream::next_line(std::string_view& line) noexcept {
    if (!lines_.next(unread_)) return false;
    line = lines_.line();
    return true;
}

}  // namespace narpa
