/// tests/fuzz/mutator.h - inputs that are nearly right: seeds with a few changes of bytes, tokens, numbers and
/// ranges.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <random>
#include <string>
#include <vector>

namespace narpa::fuzz {

class Mutator {
public:
    Mutator(std::vector<std::string> seeds, std::uint64_t seed) : seeds_(std::move(seeds)), random_(seed) {
        for (const std::string& s : seeds_) {
            is_text_.push_back(looks_like_text(s));
            most_ = std::max(most_, 2 * s.size() + 64);
            if (is_text_.back()) collect_tokens(s);
        }
    }

    std::string next() {
        const std::size_t which = below(seeds_.size());
        std::string bytes = seeds_[which];
        for (std::size_t n = 1 + below(5); n > 0; --n) mutate(bytes, is_text_[which]);
        if (bytes.size() > most_ && !one_in(50)) bytes.resize(most_);
        bytes.shrink_to_fit();  // so that the address sanitizer sees a read past the end
        return bytes;
    }

private:
    std::size_t below(std::size_t n) { return n < 2 ? 0 : random_() % n; }
    bool one_in(std::size_t n) { return below(n) == 0; }
    char any_byte() { return static_cast<char>(random_() & 0xff); }

    static bool looks_like_text(const std::string& s) {
        const auto odd = std::count_if(s.begin(), s.end(), [](char c) {
            const auto byte = static_cast<unsigned char>(c);
            return byte < 9 || (byte > 13 && byte < 32) || byte > 126;
        });
        return 20 * static_cast<std::size_t>(odd) < s.size() + 1;
    }
    static bool in_token(char c) {
        return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '.' || c == '-' ||
               c == '+' || c == '_';
    }
    void collect_tokens(const std::string& s) {
        for (std::size_t at = 0; at < s.size() && tokens_.size() < 4096;) {
            std::size_t end = at;
            while (end < s.size() && in_token(s[end])) ++end;
            if (end > at) tokens_.push_back(s.substr(at, end - at));
            at = end + 1;
        }
    }

    void mutate(std::string& s, bool is_text) {
        if (s.empty()) return void(s.push_back(any_byte()));
        const std::size_t at = below(s.size()), length = std::min(1 + below(one_in(8) ? 256 : 16), s.size() - at);
        switch (below(12)) {
            case 0: s[at] = static_cast<char>(s[at] ^ (1 << below(8))); break;
            case 1: s[at] = any_byte(); break;
            case 2: s.erase(at, length); break;
            case 3: s.insert(below(s.size()), s.substr(at, length)); break;
            case 4: one_in(4) ? s.resize(at) : s.resize(s.size() - 1); break;
            case 5: splice(s, at); break;
            case 6:
                if (one_in(20)) repeat(s, at, length);
                break;
            default: is_text ? change_token(s, at) : change_number(s, at);
        }
    }

    /// The end of another seed, or a range of it.
    void splice(std::string& s, std::size_t at) {
        const std::string& other = seeds_[below(seeds_.size())];
        if (other.empty()) return;
        const std::size_t from = below(other.size());
        if (one_in(2))
            s.replace(at, std::string::npos, other.substr(std::min(at, other.size())));
        else
            s.insert(at, other.substr(from, 1 + below(64)));
    }
    void repeat(std::string& s, std::size_t at, std::size_t length) {
        const std::string part = s.substr(at, std::min<std::size_t>(length, 8));
        std::string many;
        for (std::size_t n = std::size_t{1} << below(14); n > 0; --n) many += part;
        s.insert(at, many);
    }
    /// Another word or number in the place of one.
    void change_token(std::string& s, std::size_t at) {
        static constexpr std::array kNumbers{"0",
                                             "-0",
                                             "-1",
                                             "1",
                                             "nan",
                                             "-inf",
                                             "1e400",
                                             "1e-400",
                                             "1e300",
                                             "255",
                                             "256",
                                             "65536",
                                             "2147483648",
                                             "4294967295",
                                             "9223372036854775807",
                                             "99999999999999999999",
                                             "0.5",
                                             "",
                                             "\"",
                                             "[",
                                             "]",
                                             "{",
                                             "\\\n",
                                             "#",
                                             "\n",
                                             "\xff",
                                             "1/",
                                             "=",
                                             "--",
                                             ",",
                                             "e",
                                             "0x"};
        while (at < s.size() && !in_token(s[at])) ++at;
        std::size_t end = at;
        while (end < s.size() && in_token(s[end])) ++end;
        if (one_in(3) && at < end && s[at] >= '0' && s[at] <= '9')  // mild: a number stays one
            s[at] = static_cast<char>('0' + below(10));
        else if (one_in(2) && !tokens_.empty())
            s.replace(at, end - at, tokens_[below(tokens_.size())]);
        else
            s.replace(at, end - at, kNumbers[below(kNumbers.size())]);
    }
    /// 1, 2, 4 or 8 bytes become a number that lengths and offsets go wrong at, in either byte order.
    void change_number(std::string& s, std::size_t at) {
        static constexpr std::array<std::uint64_t, 12> kNumbers{
            0, 1, 2, 0x7f, 0x80, 0xff, 0x7fff, 0xffff, 0x7fff'ffff, 0x8000'0000, 0xffff'ffff, ~std::uint64_t{0}};
        const std::size_t bytes = std::min(std::size_t{1} << below(4), s.size() - at);
        std::uint64_t value = kNumbers[below(kNumbers.size())];
        if (one_in(2)) {  // near what it was
            value = 0;
            for (std::size_t i = 0; i < bytes; ++i)
                value |= std::uint64_t{static_cast<unsigned char>(s[at + i])} << 8 * i;
            value += below(33) - 16;
        }
        const bool is_big = one_in(2);
        for (std::size_t i = 0; i < bytes; ++i)
            s[at + (is_big ? bytes - 1 - i : i)] = static_cast<char>(value >> 8 * i & 0xff);
    }

    std::vector<std::string> seeds_, tokens_;
    std::vector<bool> is_text_;
    std::size_t most_ = 0;
    std::mt19937_64 random_;
};

}  // namespace narpa::fuzz
