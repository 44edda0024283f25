/// base/text/text_lines.h - text files as programs of all systems write them, line by line.
#pragma once

#include <algorithm>
#include <cstdint>
#include <istream>
#include <string>
#include <string_view>
#include <utility>

namespace narpa {

namespace text_lines {

/// UTF-16 behind its byte order mark, as UTF-8. A surrogate without its other half becomes U+FFFD.
inline std::string from_utf16(std::string_view bytes, bool is_big_endian) {
    const std::size_t units = bytes.size() / 2;
    const auto unit = [&](std::size_t i) -> std::uint32_t {
        const auto first = static_cast<unsigned char>(bytes[2 * i]),
                   second = static_cast<unsigned char>(bytes[2 * i + 1]);
        return is_big_endian ? first << 8u | second : second << 8u | first;
    };
    std::string out;
    out.reserve(units);
    for (std::size_t i = 0; i < units; ++i) {
        std::uint32_t code = unit(i);
        const bool is_high = code >= 0xd800 && code < 0xdc00;
        const std::uint32_t low = is_high && i + 1 < units ? unit(i + 1) : 0;
        if (low >= 0xdc00 && low < 0xe000)
            code = 0x10000 + ((code - 0xd800) << 10u) + (low - 0xdc00), ++i;
        else if (code >= 0xd800 && code < 0xe000)
            code = 0xfffd;
        const auto tail = [&](unsigned shift) { out += static_cast<char>(0x80 | (code >> shift & 0x3f)); };
        if (code < 0x80)
            out += static_cast<char>(code);
        else if (code < 0x800)
            out += static_cast<char>(0xc0 | code >> 6), tail(0);
        else if (code < 0x10000)
            out += static_cast<char>(0xe0 | code >> 12), tail(6), tail(0);
        else
            out += static_cast<char>(0xf0 | code >> 18), tail(12), tail(6), tail(0);
    }
    return out;
}

inline std::string rest_of(std::istream& in) {
    std::string text;
    do {
        const std::size_t have = text.size();
        text.resize(have + (std::size_t{1} << 16) + have / 2);
        in.read(text.data() + have, static_cast<std::streamsize>(text.size() - have));
        text.resize(have + static_cast<std::size_t>(in.gcount()));
    } while (in);
    return text;
}

}  // namespace text_lines

/// A text as UTF-8 without a byte order mark, its lines separated by '\n'. Lines may end with "\n", "\r\n" or "\r";
/// UTF-16 is recognised by its byte order mark.
[[nodiscard]] inline std::string plain_lines(std::string text) {
    if (text.starts_with("\xef\xbb\xbf")) text.erase(0, 3);
    if (text.starts_with("\xff\xfe") || text.starts_with("\xfe\xff"))
        text = text_lines::from_utf16(std::string_view(text).substr(2), text[0] == '\xfe');
    std::size_t from = text.find('\r');
    if (from == std::string::npos) return text;
    std::size_t to = from;
    for (; from < text.size(); ++from) {
        if (text[from] != '\r')
            text[to++] = text[from];
        else if (from + 1 == text.size() || text[from + 1] != '\n')
            text[to++] = '\n';
    }
    text.resize(to);
    return text;
}

/// Steps over the lines of a text.
class TextLines {
public:
    explicit TextLines(std::string text) : text_(plain_lines(std::move(text))) {}
    /// The rest of a stream. Read errors set its `bad` bit.
    explicit TextLines(std::istream& in) : TextLines(text_lines::rest_of(in)) {}

    /// False at the end. The line is valid as long as this object; it may be changed in place.
    bool next(std::string_view& line) {
        if (at_ >= text_.size()) return false;
        const std::size_t end = std::min(text_.find('\n', at_), text_.size());
        line = std::string_view(text_).substr(at_, end - at_);
        at_ = end + 1;
        ++number_;
        return true;
    }
    [[nodiscard]] int number() const { return number_; }  ///< of the line, from 1
    /// The line is the last one and has no line end: it may have been cut off.
    [[nodiscard]] bool may_be_cut() const { return at_ > text_.size(); }

private:
    std::string text_;
    std::size_t at_ = 0;
    int number_ = 0;
};

}  // namespace narpa
