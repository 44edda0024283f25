/// drivers/service_manager.h - tells the service manager that started this program how it fares: systemd's
/// protocol, datagrams of text to the socket NOTIFY_SOCKET (sd_notify(3), systemd.service(5)).
#pragma once

#include <sys/un.h>

#include <cstdint>
#include <optional>
#include <string_view>

#include "base/result.h"
#include "drivers/descriptor.h"

namespace narpa {

class ServiceManager {
public:
    /// By the environment: of a program that no service manager started, notify() does nothing. Errors: a socket
    /// that NOTIFY_SOCKET names but that cannot be opened.
    static Result<ServiceManager> from_environment();

    /// "READY=1", "WATCHDOG=1", "STOPPING=1", "STATUS=text". A manager that does not listen is not an error.
    void notify(std::string_view state) const noexcept;
    /// The manager ends the program if "WATCHDOG=1" does not come within this time; none: it does not watch.
    [[nodiscard]] std::optional<std::int64_t> watchdog_ns() const noexcept { return watchdog_ns_; }

private:
    Descriptor socket_;
    sockaddr_un address_{};
    socklen_t address_bytes_ = 0;  ///< 0: nobody listens
    std::optional<std::int64_t> watchdog_ns_;
};

}  // namespace narpa
