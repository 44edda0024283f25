#include "renderer/ephemeris/time_systems.h"

#include <erfa.h>
#include <fmt/format.h>

#include <cmath>
#include <optional>

namespace narpa {
namespace {

constexpr std::int64_t kSecond = 1'000'000'000, kDay = 86'400 * kSecond;
constexpr std::int64_t kUnixDaysOf2000 = 10'957;
constexpr double kMjdOf2000 = 51'544, kMjdZero = 2'400'000.5;
constexpr double kTtMinusTai_s = 32.184;
constexpr std::int64_t kTaiMinusGps_s = 19;
constexpr int kFirstYear = 1972, kLastYear = 2099;

/// A time of day on a day since 2000-01-01, in a scale whose days have 86400 s.
struct CalendarTime {
    int days = 0;
    std::int64_t ns = 0;
};

/// Reads parts of a text from its beginning.
class TimeText {
public:
    explicit TimeText(std::string_view text) : rest_(text) {}

    /// A whole number of exactly so many digits.
    std::optional<int> digits(std::size_t count) {
        if (rest_.size() < count) return std::nullopt;
        int value = 0;
        for (const char c : rest_.substr(0, count)) {
            if (c < '0' || c > '9') return std::nullopt;
            value = 10 * value + (c - '0');
        }
        rest_.remove_prefix(count);
        return value;
    }
    bool take(char c) {
        if (!rest_.starts_with(c)) return false;
        rest_.remove_prefix(1);
        return true;
    }
    /// Digits behind a decimal point, in ns; further ones are cut off.
    std::optional<std::int64_t> fraction_ns() {
        std::int64_t ns = 0, unit = kSecond / 10;
        bool any = false;
        for (; !rest_.empty() && rest_.front() >= '0' && rest_.front() <= '9'; rest_.remove_prefix(1), unit /= 10)
            ns += unit * (rest_.front() - '0'), any = true;
        return any ? std::optional(ns) : std::nullopt;
    }
    [[nodiscard]] bool at_end() const { return rest_.empty(); }
    [[nodiscard]] std::size_t length_to(char c) const { return rest_.find(c); }

private:
    std::string_view rest_;
};

int days_since_2000(int year, int month, int day) {
    double zero = 0, mjd = 0;
    eraCal2jd(year, month, day, &zero, &mjd);
    return static_cast<int>(mjd - kMjdOf2000);
}

/// TAI - UTC in whole seconds at the beginning of a day. ERFA warns of dates after its last leap second only.
std::int64_t leap_seconds(int days) {
    int year = 0, month = 0, day = 0;
    double fraction = 0, seconds = 0;
    eraJd2cal(kMjdZero, kMjdOf2000 + days, &year, &month, &day, &fraction);
    if (year < kFirstYear) return 10;
    eraDat(year, month, day, 0, &seconds);
    return std::llround(seconds);
}

std::optional<int> read_days(TimeText& text) {
    const std::optional<int> year = text.digits(4);
    if (!year || *year < kFirstYear || *year > kLastYear || !text.take('-')) return std::nullopt;
    if (text.length_to('T') == 3) {
        const std::optional<int> day = text.digits(3);
        const int length = days_since_2000(*year + 1, 1, 1) - days_since_2000(*year, 1, 1);
        if (!day || *day < 1 || *day > length) return std::nullopt;
        return days_since_2000(*year, 1, 1) + *day - 1;
    }
    const std::optional<int> month = text.digits(2);
    if (!month || !text.take('-')) return std::nullopt;
    const std::optional<int> day = text.digits(2);
    double zero = 0, mjd = 0;
    if (!day || eraCal2jd(*year, *month, *day, &zero, &mjd) != 0) return std::nullopt;
    return static_cast<int>(mjd - kMjdOf2000);
}

std::optional<CalendarTime> read_calendar_time(TimeText text, TimeSystem system) {
    const std::optional<int> days = read_days(text);
    if (!days || !text.take('T')) return std::nullopt;
    const std::optional<int> hour = text.digits(2);
    if (!hour || *hour > 23 || !text.take(':')) return std::nullopt;
    const std::optional<int> minute = text.digits(2);
    if (!minute || *minute > 59 || !text.take(':')) return std::nullopt;
    const std::optional<int> second = text.digits(2);
    const bool leaps =
        system == TimeSystem::utc && *hour == 23 && *minute == 59 && leap_seconds(*days + 1) > leap_seconds(*days);
    if (!second || *second > (leaps ? 60 : 59)) return std::nullopt;
    std::int64_t ns = 0;
    if (text.take('.')) {
        const auto fraction = text.fraction_ns();
        if (!fraction) return std::nullopt;
        ns = *fraction;
    }
    text.take('Z');
    if (!text.at_end()) return std::nullopt;
    return CalendarTime{*days, ns + ((*hour * 60LL + *minute) * 60 + *second) * kSecond};
}

/// TDB - TT at the Earth's centre, in ns.
std::int64_t tdb_minus_tt_ns(const CalendarTime& t) {
    const double day = static_cast<double>(t.ns) / static_cast<double>(kDay);
    return std::llround(1e9 * eraDtdb(kMjdZero, kMjdOf2000 + t.days + day, day, 0, 0, 0));
}

}  // namespace

Result<std::int64_t> tai_ns(std::string_view text, TimeSystem system) {
    const auto t = read_calendar_time(TimeText(text), system);
    if (!t)
        return Error{
            fmt::format("\"{}\", expected a time of the years {} to {}, like 2026-03-01T12:00:00.5 or "
                        "2026-060T12:00:00.5",
                        text, kFirstYear, kLastYear)};
    const std::int64_t ns = t->days * kDay + t->ns;
    switch (system) {
        case TimeSystem::utc: return ns + leap_seconds(t->days) * kSecond;
        case TimeSystem::tai: return ns;
        case TimeSystem::tdb: return ns - tdb_minus_tt_ns(*t) - std::llround(1e9 * kTtMinusTai_s);
        case TimeSystem::tt: return ns - std::llround(1e9 * kTtMinusTai_s);
        case TimeSystem::gps: break;
    }
    return ns + kTaiMinusGps_s * kSecond;
}

std::int64_t tai_ns_of_utc(std::int64_t unix_ns) {
    std::int64_t days = unix_ns / kDay;
    if (unix_ns % kDay < 0) --days;
    return unix_ns - kUnixDaysOf2000 * kDay + leap_seconds(static_cast<int>(days - kUnixDaysOf2000)) * kSecond;
}

Quat q_icrf_eme2000() {
    double bias[3][3], precession[3][3], both[3][3];
    eraBp06(kMjdZero, kMjdOf2000 + 0.5, bias, precession, both);  // bias: GCRS to the mean frame of J2000
    return quat_from_columns({bias[0][0], bias[0][1], bias[0][2]}, {bias[1][0], bias[1][1], bias[1][2]},
                             {bias[2][0], bias[2][1], bias[2][2]});
}

}  // namespace narpa
