#include "estimator/batch/brightness.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <span>

#include "estimator/batch/batch_unknowns.h"
#include "estimator/view/model_view.h"

namespace narpa {
namespace {

constexpr int kSide = BrightnessObservations::kBlock_px;
/// Largest range of a block's rendered pixels, as a part of their mean.
constexpr double kEven = 0.25;
/// Least mean of a block, as a part of the brightest in the image: in grazing light, small errors of shape matter.
constexpr double kLeastPart = 0.1;
constexpr double kTurn_rad = kDegree;

/// A render of the target: DN above black.
struct Shown {
    int width = 0;
    std::vector<float> dn;

    /// Mean over the block; nothing where it is not even.
    [[nodiscard]] std::optional<double> even_mean(int x0, int y0) const {
        double sum = 0;
        float low =
                  dn[static_cast<std::size_t>(y0) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x0)],
              high = low;
        for (int y = y0; y < y0 + kSide; ++y)
            for (int x = x0; x < x0 + kSide; ++x) {
                const float v =
                    dn[static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x)];
                sum += v, low = std::min(low, v), high = std::max(high, v);
            }
        const double mean = sum / (kSide * kSide);
        if (!(mean > 0) || high - low > kEven * mean) return {};
        return mean;
    }
};

/// Where light comes from a direction turned by `turn_rad`, world axes: target and camera are turned back.
BodyPoses in_turned_light(const BodyPoses& at, std::size_t target, const Vec3& turn_rad) {
    BodyPoses turned = at;
    Rigid3 T = at.T_world_body[target];
    T.q = normalized(exp_rotation(-turn_rad) * T.q);
    turned.set(target, T);
    return turned;
}

/// Body of each pixel's centre.
bool is_all_target(const Aovs& aovs, std::size_t target, int width, int x0, int y0) {
    for (int y = y0; y < y0 + kSide; ++y)
        for (int x = x0; x < x0 + kSide; ++x)
            if (aovs.body[static_cast<std::size_t>(y) * static_cast<std::size_t>(width) +
                          static_cast<std::size_t>(x)] != static_cast<int>(target))
                return false;
    return true;
}

/// Mean of the frame over the block, less black; nothing where it may be clipped.
std::optional<double> measured_mean(const MeasuredImage& image, double black_dn, int x0, int y0) {
    double sum = 0;
    for (int y = y0; y < y0 + kSide; ++y)
        for (int x = x0; x < x0 + kSide; ++x) {
            if (!image.clipped.empty() && image.clipped[image.index(x, y)] != 0) return {};
            sum += image.at(x, y);
        }
    return sum / (kSide * kSide) - black_dn;
}

/// Which square of the blocks' extent each lies in.
void set_parts(std::span<const std::array<int, 2>> corners, std::vector<BrightnessBlock>& blocks) {
    std::array<int, 2> low = corners.front(), high = low;
    for (const auto& c : corners)
        for (std::size_t i = 0; i < 2; ++i) low[i] = std::min(low[i], c[i]), high[i] = std::max(high[i], c[i]);
    constexpr auto kAcross = BrightnessObservations::kPartsAcross;
    const int side = std::max({high[0] - low[0], high[1] - low[1], 0}) + 1;
    const auto place = [&](int from_low) {
        return static_cast<std::size_t>(from_low) * kAcross / static_cast<std::size_t>(side);
    };
    for (std::size_t i = 0; i < blocks.size(); ++i)
        blocks[i].part = place(corners[i][1] - low[1]) * kAcross + place(corners[i][0] - low[0]);
}

}  // namespace

BrightnessObservations observe_brightness(const RenderScene& scene, const Camera& camera, std::size_t target,
                                          const BodyPoses& at, const MeasuredImage& image,
                                          const Rigid3& T_camera_target, const FrameSettings& settings,
                                          const std::array<double, 2>& light_rad) {
    ModelView view(scene, camera, target, at);
    const auto shown = [&](const Vec3& turn_rad, bool aovs) {
        view.begin_frame(in_turned_light(at, target, turn_rad), {}, {});
        view.render(T_camera_target, settings, aovs);
        return Shown{camera.width, expected_signal(camera, view.radiance())};
    };
    std::vector<Shown> turned;
    Vec3 turn{};
    if (const auto& sun = scene.scene().sun) {
        const auto axes = light_axes(normalized(sun->direction));
        turn = light_rad[0] * axes[0] + light_rad[1] * axes[1];
        for (const Vec3& axis : axes) turned.push_back(shown(turn + kTurn_rad * axis, false));
    }
    const Shown model = shown(turn, true);

    const SensorModel sensor = sensor_model(camera);
    const float brightest = model.dn.empty() ? 0 : *std::ranges::max_element(model.dn);
    BrightnessObservations out;
    out.light_rad = light_rad;
    std::vector<std::array<int, 2>> corners;
    for (int y = 0; y + kSide <= image.height; y += kSide)
        for (int x = 0; x + kSide <= image.width; x += kSide) {
            const auto mean = model.even_mean(x, y);
            if (!mean || *mean < kLeastPart * brightest || !is_all_target(view.aovs(), target, camera.width, x, y))
                continue;
            const auto measured = measured_mean(image, sensor.black_dn, x, y);
            if (!measured) continue;
            BrightnessBlock block{*measured, *mean, {}, 0, 0};
            block.variance = sensor.variance_dn2(sensor.black_dn + *mean) / (kSide * kSide);
            bool is_even = true;
            for (std::size_t i = 0; i < turned.size(); ++i) {
                const auto with_turn = turned[i].even_mean(x, y);
                is_even = is_even && with_turn;
                // Exact where brightness is the cosine of the angle of incidence.
                if (with_turn) block.by_light[i] = (*with_turn - std::cos(kTurn_rad) * *mean) / std::sin(kTurn_rad);
            }
            if (!is_even) continue;
            out.blocks.push_back(block);
            corners.push_back({x, y});
        }
    if (!out.blocks.empty()) set_parts(corners, out.blocks);
    return out;
}

}  // namespace narpa
