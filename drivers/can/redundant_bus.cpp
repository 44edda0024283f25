#include "drivers/can/redundant_bus.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <utility>

#include "base/time.h"
#include "drivers/can/buses.h"
#include "drivers/can/client_hub.h"
#include "drivers/descriptor.h"

namespace narpa {
namespace {

bool equal(const CanFrame& a, const CanFrame& b) noexcept {
    return a.id == b.id && a.extended == b.extended && a.remote == b.remote && a.fd == b.fd && a.size == b.size &&
           std::memcmp(a.data.data(), b.data.data(), a.size) == 0;
}

/// Frames of one bus that have not yet come on the other, the oldest first. The oldest leaves when there is no
/// room.
class Unmatched {
public:
    void push(const ReceivedFrame& frame) noexcept {
        if (end_ - begin_ == frames_.size()) ++begin_;
        frames_[end_++ % frames_.size()] = frame;
    }
    /// Takes out the oldest frame equal to this one. False: there is none younger than kWindow_ns.
    bool take(const CanFrame& frame, std::int64_t now_ns) noexcept {
        while (begin_ != end_ && now_ns - at(begin_).t_received_ns > kWindow_ns) ++begin_;
        for (std::size_t i = begin_; i != end_; ++i) {
            if (!equal(at(i).frame, frame)) continue;
            for (; i != begin_; --i) at(i) = at(i - 1);  // buses keep the order: mostly none is before it
            ++begin_;
            return true;
        }
        return false;
    }

private:
    /// Much longer than one bus lags behind the other, and shorter than the period in which counters repeat.
    static constexpr std::int64_t kWindow_ns = kSecond_ns;

    [[nodiscard]] ReceivedFrame& at(std::size_t i) noexcept { return frames_[i % frames_.size()]; }

    std::vector<ReceivedFrame> frames_{1024};
    std::size_t begin_ = 0, end_ = 0;
};

class RedundantBus final : public CanBus, public ClientHub {
public:
    RedundantBus(std::unique_ptr<CanBus> a, std::unique_ptr<CanBus> b) {
        sides_[0].bus = std::move(a);
        sides_[1].bus = std::move(b);
        has_hub_ = std::ranges::any_of(sides_, [](const Side& s) { return s.bus->clients() != nullptr; });
    }

    [[nodiscard]] bool receive(ReceivedFrame& out) noexcept override {
        if (!fetch()) return false;
        out = next_;
        has_next_ = false;
        ++counters_.received;
        ++sides_[read_].used;
        return true;
    }

    bool send(const CanFrame& frame) noexcept override {
        bool sent = false;
        for (std::size_t i = 0; i < sides_.size(); ++i)
            if (!redundancy_.is_cold || i == in_use_) sent = sides_[i].bus->send(frame) || sent;
        ++(sent ? counters_.sent : counters_.send_drops);
        return sent;
    }

    /// On the bus that was read last; the other one's frames are read at most kSlice_ns after they came.
    void wait(std::int64_t timeout_ns) noexcept override {
        constexpr std::int64_t kSlice_ns = 1'000'000;
        const std::int64_t until_ns = timeout_ns < 0 ? INT64_MAX : monotonic_ns() + timeout_ns;
        while (!fetch() && !is_woken()) {
            const std::int64_t left_ns = until_ns - monotonic_ns();
            if (left_ns <= 0) return;
            sides_[read_].bus->wait(std::min(left_ns, kSlice_ns));
        }
    }

    [[nodiscard]] bool carries_fd() const noexcept override {
        return sides_[0].bus->carries_fd() && sides_[1].bus->carries_fd();
    }
    [[nodiscard]] std::string description() const override {
        return sides_[0].bus->description() + " and, redundant, " + sides_[1].bus->description();
    }
    [[nodiscard]] CanAddress address() const override {
        const CanAddress a = sides_[0].bus->address(), b = sides_[1].bus->address();
        if (a.bus.empty() || b.bus.empty()) return {};
        return {a.bus + "+" + b.bus, a.pty};
    }
    [[nodiscard]] ClientHub* clients() noexcept override { return has_hub_ ? this : nullptr; }
    void set_redundancy(const BusRedundancy& redundancy) noexcept override { redundancy_ = redundancy; }
    [[nodiscard]] std::vector<BusUse> uses() const override {
        std::vector<BusUse> all;
        for (const Side& s : sides_)
            all.push_back({s.bus->description(), s.used, s.duplicates, s.idle, s.bus->counters()});
        return all;
    }
    [[nodiscard]] std::uint64_t switches() const noexcept override { return switches_; }

    // --- As a hub: of the buses that have clients

    void note_commander() noexcept override {
        sides_[read_].commanded = true;
        if (ClientHub* hub = sides_[read_].bus->clients()) hub->note_commander();
    }
    [[nodiscard]] bool commanders_left() const noexcept override {
        const auto left = [](const Side& s) {
            return !s.commanded || (s.bus->clients() != nullptr && s.bus->clients()->commanders_left());
        };
        return std::ranges::any_of(sides_, &Side::commanded) && std::ranges::all_of(sides_, left);
    }
    [[nodiscard]] bool has_clients() const noexcept override {
        return std::ranges::any_of(
            sides_, [](const Side& s) { return s.bus->clients() == nullptr || s.bus->clients()->has_clients(); });
    }
    [[nodiscard]] std::uint64_t clients_left() const noexcept override {
        std::uint64_t n = 0;
        for (const Side& s : sides_) n += s.bus->clients() ? s.bus->clients()->clients_left() : 0;
        return n;
    }

private:
    struct Side {
        std::unique_ptr<CanBus> bus;
        Unmatched unmatched{};
        std::uint64_t used = 0, duplicates = 0, idle = 0;
        std::int64_t t_heard_ns = 0;  ///< the master's last sign of life
        bool commanded = false;
    };

    /// Reads the next frame that counts into next_, from the bus that was read last while it has frames: so its
    /// order is kept.
    bool fetch() noexcept {
        for (std::size_t tried = 0; !has_next_ && tried < sides_.size(); ++tried) {
            while (!has_next_ && sides_[read_].bus->receive(next_)) has_next_ = counts(read_, next_);
            if (!has_next_) read_ = 1 - read_;
        }
        return has_next_;
    }
    [[nodiscard]] bool is_woken() const noexcept {
        std::array<pollfd, 1> fds{{{wake_fd_, POLLIN, 0}}};
        wait_ready(fds, 0);
        return fds[0].revents != 0;
    }
    /// A frame of bus i is the first of its kind, or of the bus in use.
    bool counts(std::size_t i, const ReceivedFrame& received) noexcept {
        return redundancy_.is_cold ? is_in_use(i, received) : is_first(i, received);
    }
    bool is_first(std::size_t i, const ReceivedFrame& received) noexcept {
        if (sides_[1 - i].unmatched.take(received.frame, received.t_received_ns)) {
            ++sides_[i].duplicates;
            return false;
        }
        sides_[i].unmatched.push(received);
        return true;
    }
    bool is_in_use(std::size_t i, const ReceivedFrame& received) noexcept {
        const CanFrame& f = received.frame;
        const bool lives = redundancy_.heartbeat_id == 0 || (!f.extended && f.id == redundancy_.heartbeat_id);
        if (lives) sides_[i].t_heard_ns = received.t_received_ns;
        if (i != in_use_ && lives &&
            received.t_received_ns - sides_[in_use_].t_heard_ns > redundancy_.heartbeat_timeout_ns) {
            in_use_ = i;
            ++switches_;
        }
        if (i == in_use_) return true;
        ++sides_[i].idle;
        return false;
    }

    std::array<Side, 2> sides_{};
    BusRedundancy redundancy_{};
    ReceivedFrame next_{};
    bool has_next_ = false;
    std::size_t read_ = 0, in_use_ = 0;
    std::uint64_t switches_ = 0;
    bool has_hub_ = false;
};

}  // namespace

std::unique_ptr<CanBus> make_redundant(std::unique_ptr<CanBus> a, std::unique_ptr<CanBus> b) {
    return std::make_unique<RedundantBus>(std::move(a), std::move(b));
}

std::vector<std::string> redundant_parts(const std::string& text) {
    const std::size_t plus = text.find('+');
    if (plus == std::string::npos || text.starts_with("log:")) return {};
    std::vector<std::string> parts{text.substr(0, plus), text.substr(plus + 1)};
    const auto is_bus = [](const std::string& part) {
        return can_bus_kind(part) != nullptr && !part.starts_with("log:") && part.find('+') == std::string::npos;
    };
    return std::ranges::all_of(parts, is_bus) ? parts : std::vector<std::string>{};
}

CanBusResult open_redundant(const std::string& text, CanRole role) {
    const std::vector<std::string> parts = redundant_parts(text);
    if (parts[0] == parts[1] && parts[0] != "slcan:0")
        return Error{"CAN bus \"" + text + "\": expected two different buses"};
    auto a = open_can_bus(parts[0], role);
    if (!a) return a.error();
    auto b = open_can_bus(parts[1], role);
    if (!b) return b.error();
    return make_redundant(*std::move(a), *std::move(b));
}

}  // namespace narpa
