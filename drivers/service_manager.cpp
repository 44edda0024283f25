#include "drivers/service_manager.h"

#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <cstddef>
#include <cstdlib>
#include <cstring>
#include <string>

namespace narpa {
namespace {

std::string_view environment(const char* name) {
    const char* value = std::getenv(name);
    return value ? value : "";
}

std::optional<std::int64_t> number(std::string_view text) {
    std::int64_t value = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (text.empty() || error != std::errc{} || end != text.data() + text.size()) return {};
    return value;
}

/// WATCHDOG_PID, if it is set, names the process that is watched.
std::optional<std::int64_t> watchdog_of_environment() {
    const auto us = number(environment("WATCHDOG_USEC"));
    const std::string_view pid = environment("WATCHDOG_PID");
    if (!us || *us <= 0 || (!pid.empty() && number(pid) != ::getpid())) return {};
    return 1000 * *us;
}

}  // namespace

Result<ServiceManager> ServiceManager::from_environment() {
    ServiceManager m;
    const std::string_view path = environment("NOTIFY_SOCKET");
    if (path.empty()) return m;
    if ((path.front() != '/' && path.front() != '@') || path.size() >= sizeof(m.address_.sun_path))
        return Error{"NOTIFY_SOCKET is \"" + std::string(path) + "\", expected the path of a socket, or @NAME"};
    m.address_.sun_family = AF_UNIX;
    std::ranges::copy(path, m.address_.sun_path);
    if (path.front() == '@') m.address_.sun_path[0] = '\0';  // a name without a file
    m.address_bytes_ = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + path.size());
    m.socket_ = Descriptor(::socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0));
    if (m.socket_.get() < 0)
        return Error{std::string("a socket to the service manager: ") + std::strerror(errno), "", 0, 0,
                     ErrorKind::missing};
    m.watchdog_ns_ = watchdog_of_environment();
    return m;
}

void ServiceManager::notify(std::string_view state) const noexcept {
    if (address_bytes_ == 0) return;
    // MSG_DONTWAIT: a manager that is busy may not hold the program up.
    [[maybe_unused]] const auto sent =
        ::sendto(socket_.get(), state.data(), state.size(), MSG_NOSIGNAL | MSG_DONTWAIT,
                 reinterpret_cast<const sockaddr*>(&address_), address_bytes_);
}

}  // namespace narpa
