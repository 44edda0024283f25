#include "protocols/can/slcan.h"

#include "protocols/can/hex.h"

namespace narpa {

std::size_t encode_slcan(const CanFrame& frame, std::span<char, kSlcanMaxLine> out) noexcept {
    if (frame.fd || frame.error || frame.size > 8 || frame.id > (frame.extended ? kMaxExtendedId : kMaxStandardId))
        return 0;
    char* p = out.data();
    *p++ = frame.remote ? (frame.extended ? 'R' : 'r') : (frame.extended ? 'T' : 't');
    p = put_hex(p, frame.id, frame.extended ? 8 : 3);
    p = put_hex(p, frame.size, 1);
    if (!frame.remote)
        for (const std::uint8_t b : frame.payload()) p = put_hex(p, b, 2);
    *p++ = '\r';
    return static_cast<std::size_t>(p - out.data());
}

bool decode_slcan(std::string_view line, CanFrame& out) noexcept {
    if (line.empty()) return false;
    CanFrame frame;
    frame.extended = line[0] == 'T' || line[0] == 'R';
    frame.remote = line[0] == 'r' || line[0] == 'R';
    if (!frame.extended && !frame.remote && line[0] != 't') return false;
    const std::size_t id_digits = frame.extended ? 8 : 3;
    if (line.size() < 1 + id_digits + 1) return false;
    std::uint32_t size = 0;
    if (!get_hex(line.substr(1, id_digits), frame.id) || !get_hex(line.substr(1 + id_digits, 1), size))
        return false;
    if (size > 8 || frame.id > (frame.extended ? kMaxExtendedId : kMaxStandardId)) return false;
    frame.size = static_cast<std::uint8_t>(size);
    const std::string_view data = line.substr(2 + id_digits);
    const std::size_t data_digits = frame.remote ? 0 : 2 * size, stamp_digits = 4;
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
