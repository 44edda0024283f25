#include "renderer/projection/distortion.h"

#include "renderer/projection/brown_conrady.h"
#include "renderer/projection/kannala_brandt.h"

namespace narpa {

std::shared_ptr<const CameraModel> distorted(const Pinhole& pinhole, const Distortion& distortion) {
    const auto& c = distortion.coefficients;
    const std::size_t n = c.size();
    if (distortion.model == Distortion::Model::fisheye) {
        if (n != 4) return nullptr;
        return std::make_shared<KannalaBrandt>(pinhole, KannalaBrandt::Coefficients{c[0], c[1], c[2], c[3]});
    }
    if (n != 4 && n != 5 && n != 8 && n != 12) return nullptr;
    const auto at = [&](std::size_t i) { return i < n ? c[i] : 0; };
    return std::make_shared<BrownConrady>(pinhole, BrownConrady::Coefficients{.k1 = at(0),
                                                                              .k2 = at(1),
                                                                              .k3 = at(4),
                                                                              .k4 = at(5),
                                                                              .k5 = at(6),
                                                                              .k6 = at(7),
                                                                              .p1 = at(2),
                                                                              .p2 = at(3),
                                                                              .s1 = at(8),
                                                                              .s2 = at(9),
                                                                              .s3 = at(10),
                                                                              .s4 = at(11)});
}

}  // namespace narpa
