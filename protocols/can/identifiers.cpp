#include "protocols/can/identifiers.h"

#include <array>
#include <cstdio>

namespace narpa {

Status check_body_base_id(std::int64_t can_id) {
    if (can_id >= 0 && can_id <= kMaxBodyBaseId && can_id % kBaseIdStep == 0) return Ok{};
    std::array<char, 160> text{};
    std::snprintf(text.data(), text.size(),
                  "can_id %s0x%llX cannot be a body's: expected a multiple of 16 from 0x000 to 0x%03X",
                  can_id < 0 ? "-" : "", static_cast<unsigned long long>(can_id < 0 ? -can_id : can_id),
                  kMaxBodyBaseId);
    return Error{.what = text.data()};
}

}  // namespace narpa
