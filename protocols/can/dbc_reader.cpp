#include "protocols/can/dbc_reader.h"

#include <algorithm>
#include <bit>
#include <charconv>
#include <optional>

#include "protocols/can/hex.h"

namespace narpa {
namespace {

constexpr std::size_t kMostMessages = 100'000, kMostSignals = 1'000'000;  // of a file

/// The parts of one line.
class LineScanner {
public:
    explicit LineScanner(std::string_view line) : line_(line) { skip_spaces(); }

    [[nodiscard]] int column() const { return static_cast<int>(at_) + 1; }
    /// Letters, digits and underscores; empty: there are none.
    std::string_view word() {
        const std::size_t from = at_;
        while (at_ < line_.size() && is_word(line_[at_])) ++at_;
        const std::string_view found = line_.substr(from, at_ - from);
        skip_spaces();
        return found;
    }
    bool take(char c) {
        if (at_ == line_.size() || line_[at_] != c) return false;
        ++at_;
        skip_spaces();
        return true;
    }
    template <class Number>
    std::optional<Number> number() {
        if (at_ < line_.size() && line_[at_] == '+') ++at_;
        Number value{};
        const auto [end, error] = std::from_chars(line_.data() + at_, line_.data() + line_.size(), value);
        if (error != std::errc{}) return std::nullopt;
        at_ = static_cast<std::size_t>(end - line_.data());
        skip_spaces();
        return value;
    }
    std::optional<std::string_view> quoted() {
        if (!take_quote()) return std::nullopt;
        const std::size_t from = at_, end = line_.find('"', from);
        if (end == std::string_view::npos) return std::nullopt;
        at_ = end + 1;
        skip_spaces();
        return line_.substr(from, end - from);
    }

private:
    static bool is_word(char c) {
        return (c >= '0' && c <= '9') || (c >= 'A' && c <= 'Z') || (c >= 'a' && c <= 'z') || c == '_';
    }
    bool take_quote() {
        if (at_ == line_.size() || line_[at_] != '"') return false;
        ++at_;
        return true;
    }
    void skip_spaces() {
        while (at_ < line_.size() && (line_[at_] == ' ' || line_[at_] == '\t' || line_[at_] == '\r')) ++at_;
    }

    std::string_view line_;
    std::size_t at_ = 0;
};

/// The bits of a signal from its highest to its lowest: calls `use` with the number of each bit, byte times 8 plus
/// bit.
void for_each_bit(const DbcSignal& s, const auto& use) {
    int at = s.start_bit;
    if (!s.big_endian) {
        for (int i = s.length - 1; i >= 0; --i) use(at + i);
        return;
    }
    for (int i = 0; i < s.length; ++i) {
        use(at);
        at += at % 8 == 0 ? 15 : -1;
    }
}

bool fits(const DbcSignal& s, int bytes) {
    bool inside = true;
    for_each_bit(s, [&](int bit) { inside = inside && bit / 8 < bytes; });
    return inside;
}

class DbcParser {
public:
    DbcParser(std::string_view text, const std::string& path) : text_(text), path_(path) {}

    Result<std::vector<DbcMessage>> read() {
        for (std::string_view line; next_line(line);) {
            LineScanner scan(line);
            const std::string_view keyword = scan.word();
            Status good = Ok{};
            if (keyword == "BO_") good = message(scan);
            if (keyword == "SG_") good = signal(scan);
            if (keyword == "SIG_VALTYPE_") good = value_type(scan);
            if (!good) return good.error();
        }
        return std::move(messages_);
    }

private:
    /// Lines within a quoted text are passed over: comments have several.
    bool next_line(std::string_view& line) {
        while (!text_.empty()) {
            const std::size_t end = std::min(text_.find('\n'), text_.size());
            line = text_.substr(0, end);
            text_.remove_prefix(std::min(end + 1, text_.size()));
            ++number_;
            const bool was_quoted = quoted_;
            for (std::size_t i = 0; i < line.size(); ++i)
                if (line[i] == '"' && (i == 0 || line[i - 1] != '\\')) quoted_ = !quoted_;
            if (!was_quoted) return true;
        }
        return false;
    }
    Error bad(const LineScanner& scan, std::string what) const {
        return Error{std::move(what), path_, number_, scan.column()};
    }

    /// BO_ 100 NAME: 8 SENDER
    Status message(LineScanner& scan) {
        constexpr std::uint32_t kExtended = 0x8000'0000;
        constexpr const char* kExpected = "expected a message, such as: BO_ 256 NAME: 8 SENDER";
        const auto id = scan.number<std::uint32_t>();
        if (!id) return bad(scan, kExpected);
        DbcMessage m{.name = std::string(scan.word()), .id = *id & ~kExtended, .extended = (*id & kExtended) != 0};
        if (m.name.empty() || !scan.take(':')) return bad(scan, kExpected);
        const auto size = scan.number<std::uint32_t>();
        if (!size) return bad(scan, kExpected);
        takes_signals_ = m.name != "VECTOR__INDEPENDENT_SIG_MSG";  // Vector's place for signals of no message
        if (!takes_signals_) return Ok{};
        if (m.id > (m.extended ? kMaxExtendedId : kMaxStandardId))
            return bad(scan, m.name + ": no CAN identifier, expected 11 bits, or 29 with 0x80000000 added");
        if (*size > 64) return bad(scan, m.name + ": expected 0 to 64 bytes");
        if (messages_.size() == kMostMessages) return bad(scan, "expected at most 100000 messages");
        m.size = static_cast<std::uint8_t>(*size);
        messages_.push_back(std::move(m));
        return Ok{};
    }

    /// SG_ NAME m0 : 0|16@1- (0.1,0) [0|0] "m" RECEIVER
    Status signal(LineScanner& scan) {
        constexpr const char* kExpected =
            "expected a signal, such as: SG_ NAME : 0|16@1- (0.1,0) [0|0] \"m\" RECEIVER";
        if (!takes_signals_) return Ok{};
        if (messages_.empty()) return bad(scan, "a signal before the first message");
        DbcSignal s{.name = std::string(scan.word())};
        s.multiplexed = scan.word().starts_with('m');
        if (s.name.empty() || !scan.take(':')) return bad(scan, kExpected);
        const auto start = scan.number<std::uint16_t>();
        const bool bar = scan.take('|');
        const auto length = scan.number<std::uint16_t>();
        const bool at = scan.take('@');
        const bool big = scan.take('0'), is_signed_mark = (big || scan.take('1')) && scan.take('-');
        if (!start || !bar || !length || !at || (!is_signed_mark && !scan.take('+'))) return bad(scan, kExpected);
        s.big_endian = big, s.is_signed = is_signed_mark;
        if (!scan.take('(')) return bad(scan, kExpected);
        const auto factor = scan.number<double>();
        const bool comma = scan.take(',');
        const auto offset = scan.number<double>();
        if (!factor || !comma || !offset || !scan.take(')') || !scan.take('[')) return bad(scan, kExpected);
        const bool has_range =
            scan.number<double>().has_value() && scan.take('|') && scan.number<double>().has_value();
        if (!has_range || !scan.take(']')) return bad(scan, kExpected);
        const auto unit = scan.quoted();
        if (!unit) return bad(scan, kExpected);
        s.factor = *factor, s.offset = *offset, s.unit = *unit;
        if (*length < 1 || *length > 64) return bad(scan, s.name + ": expected 1 to 64 bits");
        s.start_bit = *start, s.length = static_cast<std::uint8_t>(*length);
        DbcMessage& m = messages_.back();
        if (!fits(s, m.size))
            return bad(scan,
                       s.name + ": lies outside of " + m.name + ", which has " + std::to_string(m.size) + " bytes");
        if (++signals_ > kMostSignals) return bad(scan, "expected at most 1000000 signals");
        m.signals.push_back(std::move(s));
        return Ok{};
    }

    /// SIG_VALTYPE_ 100 NAME : 1;   1: float of 32 bits, 2: of 64
    Status value_type(LineScanner& scan) {
        constexpr const char* kExpected = "expected the type of a signal, such as: SIG_VALTYPE_ 256 NAME : 1;";
        const auto id = scan.number<std::uint32_t>();
        const std::string_view name = scan.word();
        const bool colon = scan.take(':');  // some writers leave it out
        const auto type = scan.number<int>();
        if (!id || name.empty() || !type) return bad(scan, kExpected);
        (void)colon;
        for (DbcMessage& m : messages_)
            if (m.id == (*id & 0x7FFF'FFFF) && m.extended == (*id >> 31 != 0))
                for (DbcSignal& s : m.signals) {
                    if (s.name != name) continue;
                    if ((*type == 1 && s.length != 32) || (*type == 2 && s.length != 64) || *type < 0 || *type > 2)
                        return bad(scan, s.name + ": expected 1 for a float of 32 bits, 2 for one of 64");
                    s.kind = static_cast<DbcSignal::Kind>(*type);
                }
        return Ok{};
    }

    std::string_view text_;
    const std::string& path_;
    std::vector<DbcMessage> messages_{};
    int number_ = 0;
    bool quoted_ = false, takes_signals_ = true;
    std::size_t signals_ = 0;
};

}  // namespace

double DbcSignal::value(std::span<const std::uint8_t> data) const noexcept {
    std::uint64_t raw = 0;
    for_each_bit(*this,
                 [&](int bit) { raw = raw << 1 | (data[static_cast<std::size_t>(bit / 8)] >> bit % 8 & 1u); });
    double number = static_cast<double>(raw);
    if (kind == Kind::float32) number = static_cast<double>(std::bit_cast<float>(static_cast<std::uint32_t>(raw)));
    if (kind == Kind::float64) number = std::bit_cast<double>(raw);
    if (kind == Kind::integer && is_signed)
        number = static_cast<double>(static_cast<std::int64_t>(raw << (64 - length)) >> (64 - length));
    return offset + factor * number;
}

Result<std::vector<DbcMessage>> read_dbc(std::string_view text, const std::string& path) {
    return DbcParser(text, path).read();
}

}  // namespace narpa
