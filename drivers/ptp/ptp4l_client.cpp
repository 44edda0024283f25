#include "drivers/ptp/ptp4l_client.h"

#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <span>

#include "base/time.h"
#include "drivers/descriptor.h"

namespace narpa {
namespace {

/// In this order: when the last one is answered, all ports have answered the first.
constexpr std::array kRequests{PtpDataSet::port, PtpDataSet::current, PtpDataSet::time_properties,
                               PtpDataSet::time_status_np};

/// A socket with an address of its own, to which answers go, connected to `path`; else errno.
Descriptor connect_unix(const std::string& path, int& reason) noexcept {
    Descriptor fd(::socket(AF_UNIX, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0));
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    reason = ENAMETOOLONG;
    if (path.size() >= sizeof address.sun_path) return {};
    // The family alone: the kernel chooses an abstract name, which no file has and which is gone with the socket.
    const bool bound =
        fd && ::bind(fd.get(), reinterpret_cast<const sockaddr*>(&address), sizeof(sa_family_t)) == 0;
    std::ranges::copy(path, address.sun_path);
    if (bound && ::connect(fd.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0) return fd;
    reason = errno;
    return {};
}

}  // namespace

Ptp4lClient::Ptp4lClient(const std::string& path, std::uint8_t domain) : network_{.domain = domain} {
    if (path.empty())
        paths_ = {"/var/run/ptp4lro", "/var/run/ptp4l"};
    else
        paths_ = {path};
    self_.port = static_cast<std::uint16_t>(::getpid());
}

Ptp4lReading Ptp4lClient::read() noexcept {
    Ptp4lReading best;
    for (std::size_t i = 0; i < paths_.size(); ++i) {
        const Ptp4lReading reading = read_from(paths_[i]);
        if (reading.result < best.result) continue;
        best = reading;
        used_ = i;
        if (best.result >= Ptp4lReading::Result::no_answer) break;
    }
    // gPTP's ptp4l ignores requests without its number, and the other way round.
    if (best.result == Ptp4lReading::Result::no_answer) network_.transport_specific ^= 1;
    return best;
}

Ptp4lReading Ptp4lClient::read_from(const std::string& path) noexcept {
    Ptp4lReading reading;
    int reason = 0;
    const Descriptor fd = connect_unix(path, reason);
    if (!fd) {
        if (reason == EACCES || reason == EPERM) reading.result = Ptp4lReading::Result::not_permitted;
        return reading;
    }
    reading.result = Ptp4lReading::Result::no_answer;
    const std::uint16_t first = sequence_;
    sequence_ = static_cast<std::uint16_t>(sequence_ + kRequests.size());
    for (std::size_t i = 0; i < kRequests.size(); ++i) {
        std::array<std::uint8_t, kPtpGetBytes> request{};
        encode_ptp_get(kRequests[i], network_, static_cast<std::uint16_t>(first + i), self_, request);
        if (::send(fd.get(), request.data(), request.size(), MSG_NOSIGNAL) < 0) return reading;
    }
    std::array<bool, kRequests.size()> done{};
    const std::int64_t until_ns = monotonic_ns() + kTimeout_ns;
    while (!std::ranges::all_of(done, std::identity{})) {
        const std::int64_t left_ns = until_ns - monotonic_ns();
        if (left_ns <= 0) return reading;
        pollfd wait{fd.get(), POLLIN, 0};
        wait_ready({&wait, 1}, left_ns);
        std::array<std::uint8_t, kPtpAnswerBytesMax> buffer;
        const ssize_t size = ::recv(fd.get(), buffer.data(), buffer.size(), 0);
        if (size < 0) {
            if (errno == EAGAIN || errno == EINTR) continue;
            return reading;  // ptp4l has ended
        }
        const std::span message(buffer.data(), static_cast<std::size_t>(size));
        PtpAnswer answer = PtpAnswer::not_mine;
        for (std::size_t i = 0; i < kRequests.size() && answer == PtpAnswer::not_mine; ++i) {
            answer = decode_ptp_answer(message, kRequests[i], static_cast<std::uint16_t>(first + i), self_,
                                       reading.status);
            done[i] = done[i] || answer == PtpAnswer::ok;
        }
        if (answer == PtpAnswer::malformed) ++reading.malformed;
        if (answer == PtpAnswer::refused) ++reading.refused;
    }
    reading.result = Ptp4lReading::Result::answered;
    return reading;
}

}  // namespace narpa
