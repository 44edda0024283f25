/// tests/support/srgb.h - the curve of sRGB.
#pragma once

#include <cmath>

namespace narpa::test {

/// Linear light of a code of IEC 61966-2-1, 0 to 1.
inline double light_of(double code) {
    return code <= 0.04045 ? code / 12.92 : std::pow((code + 0.055) / 1.055, 2.4);
}

}  // namespace narpa::test
