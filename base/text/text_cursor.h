/// base/text/text_cursor.h - a line-based text file (OBJ, MTL) read token by token, with places for errors.
#pragma once

#include <algorithm>
#include <span>
#include <string>
#include <string_view>
#include <utility>

#include "base/result.h"
#include "base/text/text_lines.h"
#include "base/text/text_number.h"

namespace narpa {

/// Walks over a text's lines and their tokens. A line that ends in a backslash goes on in the next one, unless a
/// comment ends it, or the next line begins with a keyword.
class TextCursor {
public:
    TextCursor(std::string text, std::string file, std::span<const std::string_view> keywords = {})
        : text_(plain_lines(std::move(text))), file_(std::move(file)) {
        join_continued_lines(keywords);
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
    /// Whether only spaces or a comment are left of this line.
    [[nodiscard]] bool at_line_end() {
        skip_space();
        return at_ == end_ || *at_ == '#';
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

    void join_continued_lines(std::span<const std::string_view> keywords) {
        for (std::size_t i = text_.find("\\\n"); i != std::string::npos; i = text_.find("\\\n", i + 2)) {
            if (has_comment(i) || std::ranges::find(keywords, word_at(i + 2)) != keywords.end()) continue;
            text_[i] = ' ', text_[i + 1] = kContinued;
        }
    }
    /// Whether a comment begins in the line before `end`.
    [[nodiscard]] bool has_comment(std::size_t end) const {
        const std::size_t newline = end > 0 ? text_.rfind('\n', end - 1) : std::string::npos,
                          start = newline == std::string::npos ? 0 : newline + 1;
        for (std::size_t i = text_.find('#', start); i < end; i = text_.find('#', i + 1))
            if (i == start || is_space(text_[i - 1])) return true;
        return false;
    }
    [[nodiscard]] std::string_view word_at(std::size_t i) const {
        const char *from = text_.data() + i, *last = text_.data() + text_.size();
        while (from < last && is_space(*from)) ++from;
        const char* to = std::find_if(from, last, [](char c) { return is_space(c) || c == '\n'; });
        return {from, static_cast<std::size_t>(to - from)};
    }

    std::string text_, file_;
    const char *at_ = nullptr, *end_ = nullptr;
};

}  // namespace narpa
