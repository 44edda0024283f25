/// drivers/ptp/ptp4l_client.h - reads the state of linuxptp's ptp4l through its UNIX socket. Nothing is set.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "protocols/ptp/management.h"

namespace narpa {

/// One reading.
struct Ptp4lReading {
    enum class Result : std::uint8_t {
        no_socket,      ///< no such file, or no process listens there: no ptp4l runs
        not_permitted,  ///< of the file's mode
        no_answer,      ///< a process listens, and did not answer all requests in time
        answered,
    };
    Result result = Result::no_socket;
    PtpStatus status{};           ///< if answered
    std::uint32_t malformed = 0;  ///< datagrams that were no valid answers
    std::uint32_t refused = 0;    ///< requests that were answered by an error status
};

/// Of one thread.
class Ptp4lClient {
public:
    /// The longest that a reading takes.
    static constexpr std::int64_t kTimeout_ns = 500'000'000;

    /// `path`: of the socket; empty: /var/run/ptp4lro, else /var/run/ptp4l.
    Ptp4lClient(const std::string& path, std::uint8_t domain);

    /// Asks once. Does not allocate.
    [[nodiscard]] Ptp4lReading read() noexcept;
    /// Of the last reading's socket.
    [[nodiscard]] const std::string& path() const noexcept { return paths_[used_]; }

private:
    [[nodiscard]] Ptp4lReading read_from(const std::string& path) noexcept;

    std::vector<std::string> paths_;
    std::size_t used_ = 0;
    PtpNetwork network_;
    PtpPortIdentity self_{};
    std::uint16_t sequence_ = 0;
};

}  // namespace narpa
