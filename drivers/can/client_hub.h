/// drivers/can/client_hub.h - what a bus with a server knows of its clients; a CanBus may be one too.
#pragma once

#include <cstdint>

namespace narpa {

class ClientHub {
public:
    virtual ~ClientHub() = default;

    /// The frame that `receive` returned last completed a command: its sender is a commander.
    virtual void note_commander() noexcept = 0;
    /// There were commanders, and all of them have left the bus.
    [[nodiscard]] virtual bool commanders_left() const noexcept = 0;
    /// A frame that is sent reaches someone.
    [[nodiscard]] virtual bool has_clients() const noexcept = 0;
    /// Clients that have come and ended since the bus was opened: no fault.
    [[nodiscard]] virtual std::uint64_t clients_left() const noexcept = 0;
};

}  // namespace narpa
