#include "renderer/optics/vignetting.h"

#include <algorithm>
#include <cmath>

#include "renderer/keys/toml_reader.h"

namespace narpa {
namespace {

constexpr TableKey kVignettingRows[]{{"cos4", rows::boolean()}, {"polynomial", rows::numbers({1, 2, 3})}};
constexpr TableKeys kVignettingKeys{.rows = kVignettingRows};
constexpr TableKey kVignettingOfCamera[]{{"vignetting", rows::table(kVignettingKeys)}};

class RelativeIllumination final : public OpticalEffect {
public:
    explicit RelativeIllumination(const Vignetting& v) : v_(v) {}
    [[nodiscard]] bool vignettes() const noexcept override { return true; }
    [[nodiscard]] double transmission(double angle_rad) const noexcept override {
        const double s = angle_rad * angle_rad, cosine = std::max(0.0, std::cos(angle_rad));
        const auto [a, b, c] = v_.polynomial;
        return std::max(0.0, (v_.cos4 ? std::pow(cosine, 4) : 1) * (1 + s * (a + s * (b + s * c))));
    }

private:
    Vignetting v_;
};

void read_vignetting(TableReader& camera, const OpticsContext&, Optics& optics) {
    auto table = camera.table("vignetting");
    if (!table) return;
    Vignetting v;
    table->read("cos4", v.cos4);
    const auto polynomial = table->numbers("polynomial").value_or(std::vector<double>{});
    std::ranges::copy(polynomial, v.polynomial.begin());
    if (!table->has("cos4") && !table->has("polynomial")) table->require("cos4", "true, or a polynomial");
    table->finish();
    optics.effects.push_back(vignetting(v));
}

}  // namespace

std::shared_ptr<const OpticalEffect> vignetting(const Vignetting& v) {
    return std::make_shared<RelativeIllumination>(v);
}

constinit const OpticsKind kVignetting{kVignettingOfCamera, read_vignetting};

}  // namespace narpa
