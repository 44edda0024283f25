/// renderer/atmosphere/scattering/hosek_wilkie_table.h - the published coefficients of Hosek and Wilkie's sky.
#pragma once

namespace narpa {

/// First index: X, Y, Z. Layout of the second: [albedo 0, 1][turbidity 1..10][control point][coefficient], and
/// [albedo][turbidity][control point].
extern const double kHosekWilkieShape[3][1080];
extern const double kHosekWilkieRadiance[3][120];

}  // namespace narpa
