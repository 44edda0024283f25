#include "renderer/frame/camera_image.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cassert>
#include <optional>

#include "base/constants.h"
#include "renderer/camera/star_light.h"
#include "renderer/frame/budgeted_frame.h"
#include "renderer/frame/camera_rays.h"
#include "renderer/frame/tuning.h"
#include "renderer/geometry/flush_denormals.h"
#include "renderer/integrator/shading.h"
#include "renderer/optics/image_optics.h"
#include "renderer/projection/tabulated_model.h"

namespace narpa {
namespace {

/// Albedo output of a surface.
Rgb base_colour(const Surface& s) {
    return is_specular(*s.material) ? ambient_reflectance(s) : s.diffuse;
}

void resize(Aovs& a, std::size_t n) {
    a.range_m.resize(n);
    a.depth_m.resize(n);
    a.position.resize(n);
    a.normal.resize(n);
    a.body.resize(n);
    a.albedo.resize(n);
    a.variance.resize(n);
}

/// Writes all outputs but the variance, which is set to 0.
void store_first_hit(const Frame& f, const Ray& ray, const Hit& hit, std::size_t pixel, Aovs& aovs) {
    const bool seen = hit.body >= 0;
    aovs.body[pixel] = hit.body;
    aovs.range_m[pixel] = seen ? hit.range_m : kInfinity;
    const Vec3 axis = f.pose.at(ray.time).q * Vec3{0, 0, 1};
    aovs.depth_m[pixel] = seen ? hit.range_m * dot(ray.direction, axis) : kInfinity;
    aovs.position[pixel] = seen ? hit.position : Vec3{};
    aovs.normal[pixel] = seen ? hit.shading_normal : Vec3{};
    aovs.variance[pixel] = 0;
    aovs.albedo[pixel] = {};
    if (seen)
        aovs.albedo[pixel] =
            base_colour(surface_at(f.tracer, f.at, hit, ray.direction, hit.range_m / f.model->pixels_per_radian()));
}

/// The outputs beside the radiance come from the rays through the pixels' centres.
void store_first_hits(const Frame& f, int width, int height, Aovs& aovs) {
    tbb::parallel_for(0, (height + kTile - 1) / kTile, [&](int row) {
        const FlushDenormals flush;
        TracedRays p;
        CameraSamples s;
        s.centre = true;
        s.sample.fill(0);
        const auto store = [&] {
            trace_centres(f, s, p);
            for (std::size_t i = 0; i < s.n; ++i) store_first_hit(f, p.rays[i], p.hits[i], s.number[i], aovs);
            s.n = 0;
        };
        const int y_end = std::min((row + 1) * kTile, height);
        for (int x_first = 0; x_first < width; x_first += 2) {  // batches of 2 x 8 pixels
            for (int y = row * kTile; y < y_end; ++y)
                for (int x = x_first; x < std::min(x_first + 2, width); ++x) {
                    s.x[s.n] = x, s.y[s.n] = y;
                    s.number[s.n++] = static_cast<std::uint32_t>(y * width + x);
                }
            store();
        }
    });
}

/// Pixels beyond the image circle of a camera that has one, row by row.
std::vector<std::uint32_t> unseen_pixels(const Camera& camera) {
    std::vector<std::uint32_t> unseen;
    const CameraModel& model = *camera.model;
    const double right = camera.width - 1, bottom = camera.height - 1;
    const std::array<ImagePoint, 4> corners{{{0, 0}, {right, 0}, {0, bottom}, {right, bottom}}};
    if (std::ranges::all_of(corners, [&](const ImagePoint& p) { return model.sees(p); })) return unseen;
    for (int y = 0; y < camera.height; ++y)
        for (int x = 0; x < camera.width; ++x)
            if (!model.sees({static_cast<double>(x), static_cast<double>(y)}))
                unseen.push_back(static_cast<std::uint32_t>(y * camera.width + x));
    return unseen;
}

FrameAccount render_uniform(FramePasses& passes, const Frame& f, std::span<const std::uint8_t> chosen,
                            RadianceImage& out, std::vector<float>* variance) {
    passes.begin(f, f.lens);
    const PassCount count = passes.uniform(f, out, variance, chosen);
    FrameAccount account;
    account.samples = count.samples;
    account.rays = count.rays;
    account.standard_error = passes.standard_error();
    account.phase_ns = passes.times();
    return account;
}

/// Sunlight by one ray, through the scene's medium.
class TracedSun final : public SunOnLens {
public:
    TracedSun(const Sun& sun, const RenderScene& scene, const BodyPoses& at)
        : SunOnLens(sun.direction, sun.irradiance_w_m2), scene_(scene), at_(at) {}
    [[nodiscard]] Rgb transmittance(const Vec3& point) const noexcept override {
        const Ray ray{point, direction()};
        if (scene_.tracer().intersect(at_, ray, kInfinity).body >= 0) return {};
        return scene_.medium() == nullptr ? Rgb{1, 1, 1} : scene_.medium()->transmittance(at_, ray, kInfinity);
    }

private:
    const RenderScene& scene_;
    const BodyPoses& at_;
};

Camera with_tabulated_rays(Camera camera) {
    camera.model = tabulated(std::move(camera.model), camera.width, camera.height);
    return camera;
}

}  // namespace

struct CameraRenderer::Impl {
    const RenderScene& render_scene;
    Camera camera;  ///< with tabulated rays
    bool with_stars;
    FramePasses passes{render_scene.tracer(), camera};
    PassCosts costs{};
    std::vector<std::uint32_t> unseen = unseen_pixels(camera);
    ImageOptics optics{camera.optics, camera.plane()};
    /// Null where there are none.
    std::unique_ptr<StarLight> stars = with_stars && render_scene.scene().stars
                                           ? std::make_unique<StarLight>(render_scene.scene(), camera)
                                           : nullptr;
    bool after_light = optics.any() || stars;
    std::int64_t expected_ns = 0;  ///< wall time of a frame of FrameSettings::spp; 0: not known
    RadianceImage before_optics{after_light ? camera.width : 0, after_light ? camera.height : 0};

    FrameAccount render(const BodyPoses& at, const CameraPose& pose, const FrameSettings& settings,
                        RadianceImage& final_image, Aovs* aovs, std::vector<float>* variance,
                        std::span<const std::uint8_t> chosen);

    /// A frame's budget, with `aim` decided.
    [[nodiscard]] FrameBudget decided(FrameBudget budget) const {
        if (budget.kind != FrameBudget::Kind::aim) return budget;
        const auto left = static_cast<double>(budget.deadline_ns - now_ns());
        budget.kind = static_cast<double>(expected_ns) <= tuning::kMaxAim * left ? FrameBudget::Kind::samples
                                                                                 : FrameBudget::Kind::time;
        return budget;
    }
    void learn(const FrameAccount& account, const FrameSettings& settings, std::int64_t wall_ns) {
        if (!account.timed) {
            expected_ns = wall_ns;
            return;
        }
        const PassCosts::Of centre =
            settings.method == RenderSettings::Method::direct ? PassCosts::Of::centres : PassCosts::Of::paths;
        const PassCosts::Of one = settings.spp == 1 && costs.known(centre) ? centre : PassCosts::Of::samples;
        expected_ns = costs.known(one)
                          ? costs.expected_ns(one, passes.pixels() * static_cast<std::uint64_t>(settings.spp))
                          : static_cast<std::int64_t>(tuning::kSkippedDecay * static_cast<double>(expected_ns));
    }

    void apply_optics(const BodyPoses& at, const CameraPose& pose, RadianceImage& out) {
        optics.apply(before_optics, out);
        if (stars) stars->add(render_scene.tracer(), render_scene.medium(), at, pose, optics, out);
        const std::optional<Sun>& sun = render_scene.scene().sun;
        std::optional<TracedSun> traced;
        if (sun) traced.emplace(*sun, render_scene, at);
        optics.add_effects({pose, traced ? &*traced : nullptr}, out);
    }
};

CameraRenderer::CameraRenderer(const RenderScene& render_scene, const Camera& camera, bool with_stars)
    : impl_(new Impl{render_scene, with_tabulated_rays(camera), with_stars}) {}
CameraRenderer::~CameraRenderer() = default;

FrameAccount CameraRenderer::render(const BodyPoses& at, const CameraPose& pose, const FrameSettings& settings,
                                    RadianceImage& out, Aovs* aovs) {
    return impl_->render(at, pose, settings, out, aovs, aovs != nullptr ? &aovs->variance : nullptr, {});
}

FrameAccount CameraRenderer::render(const BodyPoses& at, const CameraPose& pose, const FrameSettings& settings,
                                    RadianceImage& out, std::vector<float>& variance,
                                    std::span<const std::uint8_t> chosen) {
    variance.assign(out.pixels.size(), 0);
    return impl_->render(at, pose, settings, out, nullptr, &variance, chosen);
}

FrameAccount CameraRenderer::Impl::render(const BodyPoses& at, const CameraPose& pose, const FrameSettings& wanted,
                                          RadianceImage& final_image, Aovs* aovs, std::vector<float>* variance,
                                          std::span<const std::uint8_t> chosen) {
    assert(final_image.width == camera.width && final_image.height == camera.height && wanted.spp >= 1);
    const std::int64_t start_ns = now_ns();
    FrameSettings settings = wanted;
    settings.budget = decided(wanted.budget);
    RadianceImage& out = after_light ? before_optics : final_image;
    const bool uniform = settings.budget.kind == FrameBudget::Kind::samples;
    FrameAccount account;
    if (uniform || aovs != nullptr) {
        const Frame frame = make_frame(render_scene, at, camera, pose, settings);
        if (aovs != nullptr) {
            resize(*aovs, out.pixels.size());
            store_first_hits(frame, out.width, out.height, *aovs);
        }
        if (uniform) account = render_uniform(passes, frame, chosen, out, variance);
    }
    if (!uniform)
        account = render_within_budget(passes, costs, render_scene, camera, at, pose, settings, out, variance);
    account.timed = settings.budget.kind == FrameBudget::Kind::time;
    if ((uniform || account.timed) && aovs == nullptr) learn(account, settings, now_ns() - start_ns);
    for (const std::uint32_t pixel : unseen) out.pixels[pixel] = {};
    if (after_light) apply_optics(at, pose, final_image);
    return account;
}

void render_radiance(const RenderScene& render_scene, const BodyPoses& at, const Camera& camera,
                     const CameraPose& pose, const FrameSettings& settings, RadianceImage& out, Aovs* aovs) {
    CameraRenderer(render_scene, camera).render(at, pose, settings, out, aovs);
}

}  // namespace narpa
