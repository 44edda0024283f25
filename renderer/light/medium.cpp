#include "renderer/light/medium.h"

namespace narpa {
namespace {

class MeanBandMedium final : public LidarMedium {
public:
    explicit MeanBandMedium(const Medium& medium) : medium_(medium) {}
    [[nodiscard]] double transmittance(const BodyPoses& at, const Ray& ray,
                                       double range_m) const noexcept override {
        return static_cast<double>(mean_band(medium_.transmittance(at, ray, range_m)));
    }
    [[nodiscard]] double in_scattering(const BodyPoses& at, const Ray& ray, double range_m,
                                       double u) const noexcept override {
        return static_cast<double>(mean_band(medium_.along(at, ray, range_m, u).in_scattering));
    }
    [[nodiscard]] int body() const noexcept override { return medium_.body(); }

private:
    const Medium& medium_;
};

}  // namespace

std::shared_ptr<const LidarMedium> Medium::for_lidar() const {
    return std::make_shared<const MeanBandMedium>(*this);
}

}  // namespace narpa
