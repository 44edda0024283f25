#include "emulator/ptp4l_watch.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <nlohmann/json.hpp>

#include "drivers/background_thread.h"
#include "emulator/realtime.h"

namespace narpa {
namespace {

using nlohmann::json;
using Reached = Ptp4lReading::Result;

void add_reading(const Ptp4lReading& reading, const std::string& socket, Ptp4lReport& report) {
    report.last = reading;
    report.socket = socket;  // no longer than the first or the other: no memory is taken again
    ++report.readings;
    report.malformed += reading.malformed;
    report.refused += reading.refused;
    if (reading.result != Reached::answered) return;
    ++report.answered;
    if (reading.status.state != PtpPortState::slave) return;
    ++report.slave;
    report.slave_offset_ns_max = std::max(report.slave_offset_ns_max, std::abs(reading.status.offset_ns));
}

/// As linuxptp writes it: 525400.fffe.123456.
std::string identity_text(const PtpClockIdentity& i) {
    return fmt::format("{:02x}{:02x}{:02x}.{:02x}{:02x}.{:02x}{:02x}{:02x}", i[0], i[1], i[2], i[3], i[4], i[5],
                       i[6], i[7]);
}

std::string why_no_state(const Ptp4lReport& report) {
    switch (report.last.result) {
        case Reached::no_socket: return "none runs: nothing listens at " + report.socket;
        case Reached::not_permitted: return "unknown: this user may not use " + report.socket;
        case Reached::no_answer:
            return "unknown: no answer at " + report.socket + ", perhaps of another ptp4l_domain";
        case Reached::answered: break;
    }
    return {};
}

}  // namespace

json to_json(const Ptp4lReport& report) {
    json document{{"socket", report.socket},
                  {"readings", report.readings},
                  {"answered", report.answered},
                  {"malformed", report.malformed},
                  {"refused", report.refused}};
    if (const std::string why = why_no_state(report); !why.empty()) {
        document.update({{"state", nullptr}, {"reason", why}});
        return document;
    }
    const PtpStatus& s = report.last.status;
    document.update({{"state", name_of(s.state)},
                     {"ports", s.ports},
                     {"steps_removed", s.steps_removed},
                     {"offset_s", 1e-9 * s.offset_ns},
                     {"mean_path_delay_s", 1e-9 * s.mean_path_delay_ns},
                     {"grandmaster", identity_text(s.grandmaster)},
                     {"grandmaster_present", s.grandmaster_present},
                     {"tai_less_utc_s", s.tai_less_utc_s},
                     {"tai_less_utc_valid", s.tai_less_utc_valid},
                     {"ptp_timescale", s.ptp_timescale},
                     {"slave_readings", report.slave},
                     {"offset_s_max", report.slave > 0 ? json(1e-9 * report.slave_offset_ns_max) : json(nullptr)}});
    return document;
}

std::string to_text(const Ptp4lReport& report) {
    if (std::string why = why_no_state(report); !why.empty()) return why;
    const PtpStatus& s = report.last.status;
    std::string text(name_of(s.state));
    if (s.grandmaster_present) text += fmt::format(", offset from the master {:+.3f} us", 1e-3 * s.offset_ns);
    if (report.slave > 1) text += fmt::format(" (at most {:.3f} us)", 1e-3 * report.slave_offset_ns_max);
    if (s.grandmaster_present) text += fmt::format(", path delay {:.3f} us", 1e-3 * s.mean_path_delay_ns);
    return text + fmt::format(", grandmaster {}{}; time scale {}, TAI less UTC {} s{}",
                              identity_text(s.grandmaster), s.grandmaster_present ? "" : " (this clock)",
                              s.ptp_timescale ? "TAI" : "arbitrary", s.tai_less_utc_s,
                              s.tai_less_utc_valid ? "" : " (not valid)");
}

Ptp4lReport read_ptp4l(const std::string& path, std::uint8_t domain) {
    Ptp4lClient client(path, domain);
    Ptp4lReport report;
    Ptp4lReading reading = client.read();
    if (reading.result == Reached::no_answer) reading = client.read();  // with the other transportSpecific
    add_reading(reading, client.path(), report);
    return report;
}

Ptp4lWatch::Ptp4lWatch(const std::string& path, std::uint8_t domain)
    : client_(path, domain), thread_(start_without_signals([this] { watch(); })) {}

Ptp4lWatch::~Ptp4lWatch() {
    {
        const std::lock_guard lock(mutex_);
        end_ = true;
    }
    ended_.notify_one();
    thread_.join();
}

Ptp4lReport Ptp4lWatch::report() const {
    const std::lock_guard lock(mutex_);
    return report_;
}

void Ptp4lWatch::watch() {
    name_thread("narpa-ptp");
    std::unique_lock lock(mutex_);
    while (!end_) {
        lock.unlock();
        const Ptp4lReading reading = client_.read();
        lock.lock();
        add_reading(reading, client_.path(), report_);
        ended_.wait_for(lock, std::chrono::nanoseconds(kPeriod_ns), [this] { return end_; });
    }
}

}  // namespace narpa
