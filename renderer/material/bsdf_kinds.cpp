#include "renderer/material/bsdf_kind.h"

namespace narpa {

std::span<const BsdfKind* const> bsdf_kinds() noexcept {
    using namespace kinds;
    static constexpr std::array all{&lambert, &phong,           &phong_classic, &mirror, &dielectric,
                                    &ggx,     &lommel_seeliger, &lunar_lambert, &akimov, &hapke};
    return all;
}

}  // namespace narpa
