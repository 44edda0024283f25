#include "protocols/can/candump.h"

#include <algorithm>
#include <cstdio>

#include "base/text/read_number.h"
#include "protocols/can/hex.h"
#include "protocols/little_endian.h"

namespace narpa {
namespace {

constexpr std::uint32_t kErrorFlag = 0x20000000;  // linux/can.h CAN_ERR_FLAG, which candump writes into the id
constexpr std::string_view kBlanks = " \t\r";

std::string_view next_word(std::string_view& rest) {
    const std::size_t start = std::min(rest.find_first_not_of(kBlanks), rest.size());
    const std::size_t end = std::min(rest.find_first_of(kBlanks, start), rest.size());
    const std::string_view word = rest.substr(start, end - start);
    rest.remove_prefix(end);
    return word;
}

/// "(1700000000.250000)" with up to nine decimals, read as integers so that no nanosecond is lost.
bool get_stamp(std::string_view text, std::int64_t& t_ns) {
    constexpr std::uint64_t max_s = 9'000'000'000;  // seconds that fit 64-bit nanoseconds
    if (text.size() < 3 || text.front() != '(' || text.back() != ')') return false;
    text = text.substr(1, text.size() - 2);
    const std::size_t point = std::min(text.find('.'), text.size());
    const std::string_view decimals = text.substr(std::min(point + 1, text.size()));
    std::uint64_t seconds = 0, ns = 0;
    if (!read_number(text.substr(0, point), seconds) || seconds > max_s) return false;
    if (decimals.size() > 9 || (!decimals.empty() && !read_number(decimals, ns))) return false;
    for (std::size_t digits = decimals.size(); digits < 9; ++digits) ns *= 10;
    t_ns = static_cast<std::int64_t>(seconds * 1'000'000'000 + ns);
    return true;
}

/// Removes the length code of eight bytes, "_9" to "_F", from the end of a classic frame: 16 digits, or R8.
bool take_length_code(std::string_view& text) {
    const std::size_t at = text.rfind('_');
    if (at == text.npos) return true;
    std::uint32_t code = 0;
    if (at + 2 != text.size() || !get_hex(text.substr(at + 1), code) || code < 9) return false;
    text.remove_suffix(2);
    const auto digits = std::ranges::count_if(text, [](char c) { return c != '.'; });
    return digits == 16 || (digits == 2 && text[1] == '8');
}

/// VCID and priority, flags : type : acceptance field, data. Only its form is checked.
bool is_can_xl(std::string_view frame, std::size_t hash) {
    std::uint32_t number = 0;
    const std::string_view head = frame.substr(hash + 1);
    return hash == 5 && get_hex(frame.substr(0, 5), number) && head.size() > 14 && head[2] == ':' &&
           head[5] == ':' && head[14] == '#' && get_hex(head.substr(0, 2), number) &&
           get_hex(head.substr(3, 2), number) && get_hex(head.substr(6, 8), number);
}

/// What follows the first '#'.
const char* get_content(std::string_view text, CanFrame& frame) {
    if (!text.empty() && text[0] == '#') {
        std::uint32_t flags = 0;
        if (text.size() < 2 || !get_hex(text.substr(1, 1), flags))
            return "expected one hex digit of flags after ##";
        frame.fd = true;
        frame.bit_rate_switch = (flags & 1) != 0;
        text.remove_prefix(2);
    } else if (!take_length_code(text)) {
        return "expected a length code of _9 to _F after eight bytes";
    } else if (!text.empty() && (text[0] == 'R' || text[0] == 'r')) {
        frame.remote = true;
        if (text.size() == 1) return nullptr;
        if (text.size() != 2 || text[1] < '0' || text[1] > '8') return "expected a length of 0 to 8 after R";
        frame.size = static_cast<std::uint8_t>(text[1] - '0');
        return nullptr;
    }
    const std::size_t limit = frame.fd ? 64 : 8;
    std::size_t size = 0;
    while (!text.empty()) {
        if (size > 0 && text[0] == '.') text.remove_prefix(1);  // cansend allows dots between bytes
        if (size == limit)
            return frame.fd ? "expected at most 64 bytes of data" : "expected at most 8 bytes of data";
        if (text.size() < 2 || !get_hex_byte(text.substr(0, 2), frame.data[size]))
            return "expected pairs of hex digits as data";
        ++size;
        text.remove_prefix(2);
    }
    frame.size = static_cast<std::uint8_t>(size);
    return nullptr;
}

}  // namespace

CanFrame lost_frames(std::uint32_t count) noexcept {
    constexpr std::uint32_t controller_problem = 0x4;
    constexpr std::uint8_t receive_overflow = 0x01;
    CanFrame frame;
    frame.error = true;
    frame.id = controller_problem;
    frame.size = 8;
    frame.data[1] = receive_overflow;
    put_le(&frame.data[4], count);
    return frame;
}

const char* parse_candump(std::string_view line, CandumpLine& out) noexcept {
    CandumpLine read;
    if (!get_stamp(next_word(line), read.t_ns)) return "expected a stamp such as (1700000000.250000)";
    read.interface = next_word(line);
    if (read.interface.empty()) return "expected an interface name such as vcan0";
    const std::string_view frame = next_word(line), direction = next_word(line);
    if (!next_word(line).empty() || (!direction.empty() && direction != "R" && direction != "T"))
        return "expected nothing, R or T after the frame";
    const std::size_t hash = frame.find('#');
    if (hash == std::string_view::npos) return "expected a frame such as 123#DEADBEEF";
    if (is_can_xl(frame, hash)) {
        read.is_xl = true;
        out = read;
        return nullptr;
    }
    std::uint32_t id = 0;
    if ((hash != 3 && hash != 8) || !get_hex(frame.substr(0, hash), id))
        return "expected an identifier of 3 or 8 hex digits";
    read.frame.extended = hash == 8;
    if (read.frame.extended && (id & kErrorFlag) != 0) {
        read.frame.error = true;
        read.frame.extended = false;
        id &= ~kErrorFlag;
    }
    if (id > (read.frame.extended || read.frame.error ? kMaxExtendedId : kMaxStandardId))
        return "expected an identifier up to 7FF (3 digits) or 1FFFFFFF (8 digits)";
    read.frame.id = id;
    if (const char* expected = get_content(frame.substr(hash + 1), read.frame)) return expected;
    out = read;
    return nullptr;
}

std::string_view remedy_for_log(std::string_view line) noexcept {
    constexpr std::string_view kConvert = "python-can converts it: python3 -m can.logconvert FILE OUT.log";
    constexpr std::string_view kOthers[]{"timestamp,arbitration_id,", "LOGG", ";$FILEVERSION", "MDF     ",
                                         "SQLite format"};
    if (line.starts_with("date ") || line.starts_with("base "))
        return "it is a Vector ASC log; asc2log of can-utils converts it: asc2log -I FILE -O OUT.log";
    for (const std::string_view begin : kOthers)
        if (line.starts_with(begin)) return kConvert;
    const std::size_t bracket = line.find('[');
    if (bracket != line.npos && line.find(']', bracket) != line.npos && line.find('#') == line.npos)
        return "candump prints such lines for people; candump -l and -L write what is needed";
    return "";
}

std::size_t format_candump(const CandumpLine& line, std::string_view interface,
                           std::span<char, kCandumpMaxLine> out) noexcept {
    const CanFrame& frame = line.frame;
    const std::int64_t t_us = std::max<std::int64_t>(line.t_ns, 0) / 1000;
    const int head =
        std::snprintf(out.data(), out.size(), "(%010lld.%06lld) %.*s ", static_cast<long long>(t_us / 1'000'000),
                      static_cast<long long>(t_us % 1'000'000),
                      static_cast<int>(std::min<std::size_t>(interface.size(), 15)), interface.data());
    char* p = out.data() + head;
    const bool wide = frame.extended || frame.error;
    p = put_hex(p, frame.error ? frame.id | kErrorFlag : frame.id, wide ? 8 : 3);
    *p++ = '#';
    if (frame.fd) {
        *p++ = '#';
        *p++ = frame.bit_rate_switch ? '1' : '0';
    } else if (frame.remote) {
        *p++ = 'R';
        if (frame.size > 0) p = put_hex(p, frame.size, 1);
    }
    if (!frame.remote)
        for (const std::uint8_t b : frame.payload()) p = put_hex(p, b, 2);
    *p++ = '\n';
    return static_cast<std::size_t>(p - out.data());
}

}  // namespace narpa
