/// emulator/ptp4l_watch.h - reads ptp4l's state once a second on a thread of its own, without real-time priority.
/// The loop never reads it.
#pragma once

#include <condition_variable>
#include <cstdint>
#include <mutex>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <thread>

#include "drivers/ptp/ptp4l_client.h"

namespace narpa {

/// The last reading, and what all of them have shown.
struct Ptp4lReport {
    Ptp4lReading last{};
    std::string socket{};  ///< of the last reading
    std::uint64_t readings = 0, answered = 0, malformed = 0, refused = 0;
    std::uint64_t slave = 0;         ///< readings in which a port was SLAVE
    double slave_offset_ns_max = 0;  ///< the largest offset from the master in those
};

/// As the JSON report has it, and as one line of text without its end: "SLAVE, offset ..." or why there is no
/// state.
[[nodiscard]] nlohmann::json to_json(const Ptp4lReport& report);
[[nodiscard]] std::string to_text(const Ptp4lReport& report);

class Ptp4lWatch {
public:
    static constexpr std::int64_t kPeriod_ns = 1'000'000'000;

    /// `path`, `domain`: as of Ptp4lClient.
    Ptp4lWatch(const std::string& path, std::uint8_t domain);
    ~Ptp4lWatch();
    Ptp4lWatch(const Ptp4lWatch&) = delete;
    Ptp4lWatch& operator=(const Ptp4lWatch&) = delete;

    /// From any thread.
    [[nodiscard]] Ptp4lReport report() const;

private:
    void watch();

    Ptp4lClient client_;  ///< of the thread
    mutable std::mutex mutex_;
    std::condition_variable ended_;
    bool end_ = false;
    Ptp4lReport report_;
    std::thread thread_;  ///< declared last: it uses the others
};

/// One reading, now.
[[nodiscard]] Ptp4lReport read_ptp4l(const std::string& path, std::uint8_t domain);

}  // namespace narpa
