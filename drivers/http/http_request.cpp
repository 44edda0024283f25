#include "drivers/http/http_request.h"

#include <algorithm>
#include <cctype>
#include <optional>
#include <utility>

#include "base/text/read_number.h"

namespace narpa {
namespace {

bool same_word(std::string_view a, std::string_view b) {
    return std::ranges::equal(a, b,
                              [](unsigned char x, unsigned char y) { return std::tolower(x) == std::tolower(y); });
}

std::string_view trimmed(std::string_view text) {
    const std::size_t first = text.find_first_not_of(" \t");
    return first == text.npos ? std::string_view{} : text.substr(first, text.find_last_not_of(" \t") - first + 1);
}

std::optional<char> hex_pair(std::string_view text) {
    unsigned value = 0;
    for (const char c : text.substr(0, 2)) {
        const auto u = static_cast<unsigned char>(c);
        if (!std::isxdigit(u)) return std::nullopt;
        value = 16 * value + static_cast<unsigned>(std::isdigit(u) ? u - '0' : std::tolower(u) - 'a' + 10);
    }
    return text.size() < 2 ? std::nullopt : std::optional<char>(static_cast<char>(value));
}

std::string decode(std::string_view text, bool plus_is_space) {
    std::string out;
    for (std::size_t i = 0; i < text.size(); ++i) {
        const std::optional<char> byte = text[i] == '%' ? hex_pair(text.substr(i + 1)) : std::nullopt;
        out += byte ? *byte : plus_is_space && text[i] == '+' ? ' ' : text[i];
        if (byte) i += 2;
    }
    return out;
}

}  // namespace

std::string decode_query(std::string_view text) {
    return decode(text, true);
}

HttpRequestReader::State HttpRequestReader::take(std::string_view bytes) {
    if (state_ != State::more) return state_;
    if (has_head_) {
        request_.body += bytes.substr(0, body_bytes_ - request_.body.size());
    } else {
        // The empty line that ends the head may be split between two reads.
        const std::size_t from = text_.size() < 3 ? 0 : text_.size() - 3;
        text_ += bytes.substr(0, kHeadBytesMost + kBodyBytesMost);
        const std::size_t end = text_.find("\r\n\r\n", from);
        if (std::min(end, text_.size()) > kHeadBytesMost)
            return refuse(431, "the request's head is longer than " + std::to_string(kHeadBytesMost) + " bytes");
        if (end == text_.npos) return state_;
        if (read_head(end) == State::refused) return state_;
        request_.body = text_.substr(end + 4, body_bytes_);
        text_.clear();
    }
    if (request_.body.size() == body_bytes_) state_ = State::complete;
    return state_;
}

bool HttpRequestReader::wants_continue() noexcept {
    return state_ == State::more && has_head_ && request_.body.empty() && std::exchange(continue_, false);
}

HttpRequestReader::State HttpRequestReader::refuse(int status, std::string reason) {
    status_ = status;
    reason_ = std::move(reason);
    text_.clear();
    return state_ = State::refused;
}

HttpRequestReader::State HttpRequestReader::read_head(std::size_t end) {
    const std::string_view head = std::string_view(text_).substr(0, end);
    const std::size_t first_end = std::min(head.find("\r\n"), head.size());
    const std::string_view first = head.substr(0, first_end);
    const std::size_t space = first.find(' '), second = first.rfind(' ');
    if (space == first.npos || space == second || !first.substr(second + 1).starts_with("HTTP/1."))
        return refuse(400, "expected a request line: METHOD /PATH HTTP/1.1");
    request_.method = first.substr(0, space);
    const std::string_view target = first.substr(space + 1, second - space - 1);
    if (!target.starts_with('/')) return refuse(400, "expected a path that begins with /");
    const std::size_t question = std::min(target.find('?'), target.size());
    request_.path = decode(target.substr(0, question), false);
    request_.query = target.substr(std::min(question + 1, target.size()));
    for (std::size_t at = first_end; at < head.size();) {
        const std::size_t next = std::min(head.find("\r\n", at + 2), head.size());
        if (read_field(head.substr(at + 2, next - at - 2)) == State::refused) return state_;
        at = next;
    }
    has_head_ = true;
    return state_;
}

HttpRequestReader::State HttpRequestReader::read_field(std::string_view line) {
    const std::size_t colon = line.find(':');
    if (colon == line.npos) return refuse(400, "expected header fields as NAME: VALUE");
    const std::string_view name = line.substr(0, colon), value = trimmed(line.substr(colon + 1));
    if (same_word(name, "Transfer-Encoding")) return refuse(501, "expected Content-Length, not Transfer-Encoding");
    if (same_word(name, "Expect")) continue_ = same_word(value, "100-continue");
    if (!same_word(name, "Content-Length")) return state_;
    if (!read_number(value, body_bytes_)) return refuse(400, "expected a number as Content-Length");
    if (body_bytes_ > kBodyBytesMost)
        return refuse(413, "the request's body is longer than " + std::to_string(kBodyBytesMost) + " bytes");
    return state_;
}

}  // namespace narpa
