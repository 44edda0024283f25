/// tests/fuzz/can_frames.h - CAN frames of fuzz inputs.
#pragma once

#include <algorithm>
#include <string_view>

#include "protocols/can/frame.h"

namespace narpa::fuzz {

inline bool is_valid(const CanFrame& f) {
    return f.id <= (f.extended || f.error ? 0x1FFFFFFFu : 0x7FFu) && f.size <= (f.fd ? 64 : 8) &&
           !(f.fd && f.remote);
}

template <class Use>
void for_each_line(std::string_view text, Use use) {
    while (!text.empty()) {
        const std::size_t end = std::min(text.find('\n'), text.size());
        use(text.substr(0, end));
        text.remove_prefix(std::min(end + 1, text.size()));
    }
}

}  // namespace narpa::fuzz
