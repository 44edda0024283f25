#include "protocols/can/slcan.h"

#include <algorithm>

#include "protocols/can/hex.h"

namespace narpa {

namespace {

/// Bytes of data by DLC.
constexpr std::array<std::uint8_t, 16> kLengths{0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64};

/// The DLC of a frame of `size` bytes; 16: no frame has that length.
std::uint32_t dlc_of(std::uint8_t size) noexcept {
    return static_cast<std::uint32_t>(std::ranges::find(kLengths, size) - kLengths.begin());
}

/// What the first letter of a line of data says; the capital one has a 29-bit identifier.
struct SlcanLetter {
    char standard, extended;
    bool remote, fd, bit_rate_switch;
};
constexpr std::array kLetters{SlcanLetter{'t', 'T', false, false, false}, SlcanLetter{'r', 'R', true, false, false},
                              SlcanLetter{'d', 'D', false, true, false}, SlcanLetter{'b', 'B', false, true, true}};

}  // namespace

std::size_t encode_slcan(const CanFrame& frame, std::span<char, kSlcanMaxLine> out) noexcept {
    const std::uint32_t dlc = dlc_of(frame.size);
    if (frame.error || (frame.fd && frame.remote) || dlc > (frame.fd ? 15u : 8u) ||
        frame.id > (frame.extended ? kMaxExtendedId : kMaxStandardId))
        return 0;
    const SlcanLetter& letter = kLetters[frame.remote ? 1 : !frame.fd ? 0 : frame.bit_rate_switch ? 3 : 2];
    char* p = out.data();
    *p++ = frame.extended ? letter.extended : letter.standard;
    p = put_hex(p, frame.id, frame.extended ? 8 : 3);
    p = put_hex(p, dlc, 1);
    if (!frame.remote)
        for (const std::uint8_t b : frame.payload()) p = put_hex(p, b, 2);
    *p++ = '\r';
    return static_cast<std::size_t>(p - out.data());
}

bool decode_slcan(std::string_view line, CanFrame& out) noexcept {
    if (line.empty()) return false;
    const auto* const letter = std::ranges::find_if(
        kLetters, [&](const SlcanLetter& l) { return line[0] == l.standard || line[0] == l.extended; });
    if (letter == kLetters.end()) return false;
    CanFrame frame{.extended = line[0] == letter->extended,
                   .remote = letter->remote,
                   .fd = letter->fd,
                   .bit_rate_switch = letter->bit_rate_switch};
    const std::size_t id_digits = frame.extended ? 8 : 3;
    if (line.size() < 1 + id_digits + 1) return false;
    std::uint32_t dlc = 0;
    if (!get_hex(line.substr(1, id_digits), frame.id) || !get_hex(line.substr(1 + id_digits, 1), dlc)) return false;
    if (dlc > (frame.fd ? 15u : 8u) || frame.id > (frame.extended ? kMaxExtendedId : kMaxStandardId)) return false;
    frame.size = kLengths[dlc];
    const std::string_view data = line.substr(2 + id_digits);
    const std::size_t data_digits = frame.remote ? 0 : std::size_t{2} * frame.size, stamp_digits = 4;
    if (data.size() != data_digits && data.size() != data_digits + stamp_digits) return false;
    for (std::size_t i = 0; i < data_digits / 2; ++i)
        if (!get_hex_byte(data.substr(2 * i, 2), frame.data[i])) return false;
    std::uint32_t stamp = 0;
    if (data.size() > data_digits && !get_hex(data.substr(data_digits), stamp)) return false;
    out = frame;
    return true;
}

bool SlcanLines::next(std::span<const char>& bytes) noexcept {
    if (done_) {
        done_ = false;
        size_ = 0;
    }
    while (!bytes.empty()) {
        const char c = bytes.front();
        bytes = bytes.subspan(1);
        if (c == '\r' || c == '\n' || c == '\a') {
            const bool overlong = skipping_;
            skipping_ = false;
            if (overlong || size_ == 0) {
                size_ = 0;
                continue;
            }
            return done_ = true;
        }
        if (skipping_) continue;
        if (size_ == buffer_.size()) {
            skipping_ = true;
            ++overlong_;
            continue;
        }
        buffer_[size_++] = c;
    }
    return false;
}

}  // namespace narpa
