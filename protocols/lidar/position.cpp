#include "protocols/lidar/position.h"

#include <algorithm>
#include <array>
#include <chrono>

#include "protocols/little_endian.h"

namespace narpa::vlp16 {
namespace {

constexpr std::size_t kTimeOffset = 198, kPpsOffset = kTimeOffset + 4, kSentenceOffset = kPpsOffset + 1 + 3;
constexpr std::int64_t kHourS = 3600, kSecondNs = 1'000'000'000;

// Status A: valid. Time and date are filled in; the checksum follows the star.
constexpr std::string_view kSentence = "$GPRMC,hhmmss,A,0000.0000,N,00000.0000,E,000.0,000.0,ddmmyy,000.0,E*";
constexpr std::size_t kTimeField = kSentence.find("hhmmss"), kDateField = kSentence.find("ddmmyy");
constexpr int kFieldTime = 1, kFieldStatus = 2, kFieldDate = 9;

void put_pair(std::uint8_t* at, unsigned value) {
    at[0] = static_cast<std::uint8_t>('0' + value / 10 % 10);
    at[1] = static_cast<std::uint8_t>('0' + value % 10);
}

int digit(char c) {
    return c >= '0' && c <= '9' ? c - '0' : -1;
}

int hex_digit(char c) {
    return c >= 'A' && c <= 'F' ? c - 'A' + 10 : digit(c);
}

// The three pairs of digits of "hhmmss" or "ddmmyy".
std::optional<std::array<int, 3>> pairs(std::string_view text) {
    if (text.size() < 6) return std::nullopt;
    std::array<int, 3> values{};
    for (std::size_t i = 0; i < 3; ++i) {
        const int tens = digit(text[2 * i]), ones = digit(text[2 * i + 1]);
        if (tens < 0 || ones < 0) return std::nullopt;
        values[i] = 10 * tens + ones;
    }
    return values;
}

// NMEA 0183: exclusive or of what stands between `$` and `*`.
std::uint8_t checksum(std::string_view between) {
    std::uint8_t sum = 0;
    for (const char c : between) sum = static_cast<std::uint8_t>(sum ^ static_cast<std::uint8_t>(c));
    return sum;
}

std::string_view field(std::string_view sentence, int index) {
    for (; index > 0; --index) {
        const std::size_t comma = sentence.find(',');
        if (comma == sentence.npos) return {};
        sentence.remove_prefix(comma + 1);
    }
    return sentence.substr(0, sentence.find_first_of(",*"));
}

// Seconds since 1970 that a GPRMC sentence says; two-digit years are 1970 to 2069.
std::optional<std::int64_t> utc_of(std::string_view text) {
    const std::size_t star = text.find('*');
    if (!text.starts_with("$GPRMC,") || star == text.npos || text.size() < star + 5) return std::nullopt;
    if (text.substr(star + 3, 2) != "\r\n") return std::nullopt;
    const int high = hex_digit(text[star + 1]), low = hex_digit(text[star + 2]);
    if (high < 0 || low < 0 || 16 * high + low != checksum(text.substr(1, star - 1))) return std::nullopt;
    const auto time = pairs(field(text, kFieldTime)), date = pairs(field(text, kFieldDate));
    if (!time || !date || field(text, kFieldStatus) != "A") return std::nullopt;
    const auto [hour, minute, second] = *time;
    const auto [day, month, year] = *date;
    const std::chrono::year_month_day ymd{std::chrono::year{year < 70 ? 2000 + year : 1900 + year},
                                          std::chrono::month{static_cast<unsigned>(month)},
                                          std::chrono::day{static_cast<unsigned>(day)}};
    if (!ymd.ok() || hour > 23 || minute > 59 || second > 60) return std::nullopt;
    const std::int64_t days = std::chrono::sys_days{ymd}.time_since_epoch().count();
    return ((days * 24 + hour) * 60 + minute) * 60 + second;
}

}  // namespace

void encode_position(std::int64_t unix_ns, std::span<std::uint8_t, kPositionPacketBytes> out) noexcept {
    using namespace std::chrono;
    const sys_time<nanoseconds> now{nanoseconds{unix_ns}};
    const year_month_day date{floor<days>(now)};
    const hh_mm_ss time{floor<seconds>(now) - floor<days>(now)};
    const std::int64_t past_hour_ns = (now - floor<hours>(now)).count();

    std::ranges::fill(out, std::uint8_t{0});
    put_le(&out[kTimeOffset], static_cast<std::uint32_t>(past_hour_ns / 1000));
    out[kPpsOffset] = static_cast<std::uint8_t>(PpsState::locked);

    std::uint8_t* text = &out[kSentenceOffset];
    std::ranges::copy(kSentence, text);
    put_pair(text + kTimeField, static_cast<unsigned>(time.hours().count()));
    put_pair(text + kTimeField + 2, static_cast<unsigned>(time.minutes().count()));
    put_pair(text + kTimeField + 4, static_cast<unsigned>(time.seconds().count()));
    put_pair(text + kDateField, static_cast<unsigned>(date.day()));
    put_pair(text + kDateField + 2, static_cast<unsigned>(date.month()));
    put_pair(text + kDateField + 4, static_cast<unsigned>(static_cast<int>(date.year()) % 100));
    std::uint8_t sum = 0;
    for (std::size_t i = 1; i + 1 < kSentence.size(); ++i) sum = static_cast<std::uint8_t>(sum ^ text[i]);
    constexpr std::string_view hex = "0123456789ABCDEF";
    const std::array<char, 4> tail{hex[sum >> 4], hex[sum & 15], '\r', '\n'};
    std::ranges::copy(tail, text + kSentence.size());
}

std::optional<PositionPacket> decode_position(std::span<const std::uint8_t> bytes) noexcept {
    if (bytes.size() != kPositionPacketBytes || bytes[kPpsOffset] > static_cast<std::uint8_t>(PpsState::error))
        return std::nullopt;
    const std::string_view text{reinterpret_cast<const char*>(&bytes[kSentenceOffset]),
                                kPositionPacketBytes - kSentenceOffset};
    const std::optional<std::int64_t> unix_s = utc_of(text);
    const auto past_hour_us = get_le<std::uint32_t>(&bytes[kTimeOffset]);
    if (!unix_s || past_hour_us >= kHourS * kSecondNs / 1000) return std::nullopt;
    return PositionPacket{past_hour_us, static_cast<PpsState>(bytes[kPpsOffset]), *unix_s};
}

}  // namespace narpa::vlp16
