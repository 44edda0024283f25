#include "renderer/optics/veiling_glare.h"

#include "renderer/keys/toml_reader.h"

namespace narpa {
namespace {

constexpr TableKey kVeilingGlareOfCamera[]{
    {"veiling_glare", rows::number({.low = 0, .high = 1, .high_open = true})}};

class Veil final : public ImageEffect {
public:
    explicit Veil(float share) : share_(share) {}
    void apply(const ImageExposure&, RadianceImage& image) noexcept override {
        Vec3 sum;
        for (const Rgb& c : image.pixels) sum = sum + vec_cast<double>(c);
        const Rgb veil = share_ * vec_cast<float>(sum / static_cast<double>(image.pixels.size()));
        for (Rgb& c : image.pixels) c = (1 - share_) * c + veil;
    }

private:
    float share_;
};

class VeilingGlare final : public OpticalEffect {
public:
    explicit VeilingGlare(double share) : share_(share) {}
    [[nodiscard]] std::unique_ptr<ImageEffect> make(const ImagePlane&) const override {
        return std::make_unique<Veil>(static_cast<float>(share_));
    }
    [[nodiscard]] bool spreads_light() const noexcept override { return true; }

private:
    double share_;
};

void read_veiling_glare(TableReader& camera, const OpticsContext&, Optics& optics) {
    const double share = camera.number("veiling_glare").value_or(0);
    if (share > 0) optics.effects.push_back(veiling_glare(share));
}

}  // namespace

std::shared_ptr<const OpticalEffect> veiling_glare(double share) {
    return std::make_shared<VeilingGlare>(share);
}

constinit const OpticsKind kVeilingGlare{kVeilingGlareOfCamera, read_veiling_glare};

}  // namespace narpa
