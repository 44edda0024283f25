/// drivers/can/client_hub.h - interface of a bus that knows its clients (slcan); a CanBus may implement it too.
#pragma once

#include <cstdint>

namespace narpa {

class ClientHub {
public:
    virtual ~ClientHub() = default;

    /// The last frame from `receive` completed a command: its sender is a commander.
    virtual void note_commander() noexcept = 0;
    /// There were commanders, and all of them have left the bus.
    [[nodiscard]] virtual bool commanders_left() const noexcept = 0;
    /// At least one client would receive a frame that is sent.
    [[nodiscard]] virtual bool has_clients() const noexcept = 0;
    /// Clients that have disconnected since the bus was opened, which is no fault.
    [[nodiscard]] virtual std::uint64_t clients_left() const noexcept = 0;
};

}  // namespace narpa
