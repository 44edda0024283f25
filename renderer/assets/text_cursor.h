/// renderer/assets/text_cursor.h - a line-based text file (OBJ, MTL) read token by token, with places for errors.
#pragma once

#include <algorithm>
#include <charconv>
#include <limits>
#include <optional>
#include <string>
#include <string_view>

#include "base/result.h"

namespace narpa {

/// Walks over a text's lines and their tokens. A line that ends in a backslash goes on in the next one.
class TextCursor {
public:
    TextCursor(std::string text, std::string file) : text_(std::move(text)), file_(std::move(file)) {
        join_continued_lines();
        at_ = end_ = text_.data() - 1;
    }
    TextCursor(const TextCursor&) = delete;
    TextCursor& operator=(const TextCursor&) = delete;

    /// Steps to the next line; false at the end.
    bool next_line() {
        const char* last = text_.data() + text_.size();
        if (end_ >= last) return false;
        at_ = end_ + 1;
        end_ = std::find(at_, last, '\n');
        return true;
    }
    /// The next token of this line; empty at its end or at a comment.
    std::string_view token() {
        skip_space();
        if (at_ < end_ && *at_ == '#') at_ = end_;
        const char* from = at_;
        while (at_ < end_ && !is_space(*at_)) ++at_;
        return {from, static_cast<std::size_t>(at_ - from)};
    }
    /// What is left of the line, without the spaces around it.
    std::string_view rest() {
        skip_space();
        const char *from = at_, *to = end_;
        while (to > from && is_space(to[-1])) --to;
        at_ = end_;
        return {from, static_cast<std::size_t>(to - from)};
    }
    /// An error at a token of this file.
    [[nodiscard]] Error error(std::string_view token, std::string what) const {
        const char* place = token.data() ? token.data() : at_;
        const auto is_newline = [](char c) { return c == '\n' || c == kContinued; };
        const std::string_view before(text_.data(), static_cast<std::size_t>(place - text_.data()));
        const auto line = 1 + std::count_if(before.begin(), before.end(), is_newline);
        const auto column = 1 + (std::find_if(before.rbegin(), before.rend(), is_newline) - before.rbegin());
        return {.what = std::move(what),
                .file = file_,
                .line = static_cast<int>(line),
                .column = static_cast<int>(column)};
    }

private:
    static constexpr char kContinued = '\v';  ///< stands for the line break after a backslash
    static bool is_space(char c) { return c == ' ' || c == '\t' || c == '\r' || c == kContinued; }
    void skip_space() {
        while (at_ < end_ && is_space(*at_)) ++at_;
    }
    void join_continued_lines() {
        for (std::size_t i = text_.find('\\'); i != std::string::npos; i = text_.find('\\', i + 1)) {
            std::size_t newline = i + 1;
            if (newline < text_.size() && text_[newline] == '\r') ++newline;
            if (newline < text_.size() && text_[newline] == '\n') text_[i] = ' ', text_[newline] = kContinued;
        }
    }

    std::string text_, file_;
    const char *at_ = nullptr, *end_ = nullptr;
};

/// The number that a token is, NaN and infinity included; nullopt when it is none.
inline std::optional<double> number_from(std::string_view token) {
    if (token.size() > 1 && token[0] == '+' && token[1] != '-') token.remove_prefix(1);
    double x = 0;
    const auto [end, problem] = std::from_chars(token.data(), token.data() + token.size(), x);
    if (end != token.data() + token.size() || token.empty()) return std::nullopt;
    if (problem == std::errc::result_out_of_range)  // either way; an exponent below zero has a minus sign
        return token.find("e-") == token.npos && token.find("E-") == token.npos
                   ? std::numeric_limits<double>::infinity()
                   : 0.0;
    return problem == std::errc() ? std::optional(x) : std::nullopt;
}

}  // namespace narpa
