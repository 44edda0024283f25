/// renderer/atmosphere/air_kind.h - the kinds of planets' air, one row of air_kinds.cpp each.
#pragma once

#include <span>
#include <string_view>

#include "renderer/atmosphere/air.h"
#include "renderer/keys/keys.h"

namespace narpa {

class TableReader;

struct AirKind {
    std::string_view name;             ///< `planet` of [atmosphere]
    std::span<const TableKey> keys{};  ///< of [atmosphere], beside those of all planets
    AirDescription (*standard)() = nullptr;
    void (*read)(TableReader& table, AirDescription& air) = nullptr;  ///< reads `keys`
    AirCoefficients (*coefficients)(const AirDescription& air, double wavelength_m) = nullptr;
};

/// All kinds, in the order of the documents.
[[nodiscard]] std::span<const AirKind* const> air_kinds();

}  // namespace narpa
