#include "renderer/integrator/shading.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "renderer/material/texture/texture_lookup.h"

namespace narpa {
namespace {

/// Bound for grazing rays: a footprint is at most 1 / this longer than wide.
constexpr double kMinCosine = 1e-3;
/// Smallest cosine between the viewer and a normal from a map.
constexpr double kMinFacing = 1e-3;
/// 16 bits have no code for 0.5, where a normal map is flat: the two nearest codes are this far off.
constexpr float kNearMiddle = 1.0f / 65535 + 1e-6f;
/// Rounding to 8 bits may shorten a normal by this much.
constexpr float kRounding = 1.0f / 255;

/// Texture axes in the plane perpendicular to a normal.
struct Tangents {
    Vec3 along_u{}, along_v{};  ///< world metres per unit of u and of v
    double det = 0;  ///< determinant of along_u, along_v and the normal: negative if the texture is mirrored, 0 if
                     ///< there is none
};

Tangents tangents(const TextureFrame& frame, const Vec3& n) {
    Tangents t{frame.dp_du - dot(n, frame.dp_du) * n, frame.dp_dv - dot(n, frame.dp_dv) * n};
    t.det = dot(n, cross(t.along_u, t.along_v));
    return t;
}

TextureFootprint footprint_of_axes(double du1, double dv1, double du2, double dv2) {
    const auto axis = [](double du, double dv) -> std::array<float, 2> {
        constexpr double most = 1e30;  // more than any image; NaN stays NaN
        return {static_cast<float>(std::clamp(du, -most, most)), static_cast<float>(std::clamp(dv, -most, most))};
    };
    return {axis(du1, dv1), axis(du2, dv2)};
}

/// Texture footprint of a pixel's beam on the surface.
TextureFootprint spot(const TextureFrame& frame, const Hit& hit, const Vec3& ray_direction, double width_m,
                      TextureLayout layout) {
    const double half_m = 0.5 * width_m;
    const double metres_per_v = norm(frame.dp_dv);
    if (!(half_m > 0) || !(metres_per_v > 0)) return {};
    const bool globe = layout == TextureLayout::globe;
    const Vec3& n = hit.geometric_normal;
    const Tangents t = tangents(frame, n);
    if (t.det == 0) return globe ? footprint_of_axes(0.5, 0, 0, half_m / metres_per_v) : TextureFootprint{};

    // The beam's circle, projected along the ray onto the surface: same width, longer by 1 / cos of the incidence,
    // or less where a globe curves away: half_m = x cos + x^2 / (2 R), solved for x.
    const double cosine = std::max(std::abs(dot(n, ray_direction)), kMinCosine);
    const double curvature_1_m = globe ? std::numbers::pi / metres_per_v : 0;
    const double longer = 2 / (cosine + std::sqrt(cosine * cosine + 2 * half_m * curvature_1_m));
    Vec3 across = cross(n, ray_direction);
    if (!(norm(across) > 1e-9)) across = t.along_v;  // normal incidence: any direction will do
    across = half_m * normalized(across);
    const Vec3 along = longer * cross(n, across);

    const Vec3 du_per_m = (1 / t.det) * cross(t.along_v, n), dv_per_m = (1 / t.det) * cross(n, t.along_u);
    double du1 = dot(du_per_m, across), du2 = dot(du_per_m, along);
    if (const double turn = 2 * std::hypot(du1, du2); globe && turn > 1) du1 /= turn, du2 /= turn;  // one turn
    return footprint_of_axes(du1, dot(dv_per_m, across), du2, dot(dv_per_m, along));
}

/// Bump mapping: J. F. Blinn, "Simulation of wrinkled surfaces", SIGGRAPH 1978, for heights that are small compared
/// with the radius of curvature.
Vec3 bumped(const Vec3& n, const TextureFrame& frame, const TextureSlope& slope_m) {
    const Tangents t = tangents(frame, n);
    if (t.det == 0) return n;
    const Vec3 gradient = (1 / t.det) * (static_cast<double>(slope_m.du) * cross(t.along_v, n) +
                                         static_cast<double>(slope_m.dv) * cross(n, t.along_u));
    const Vec3 turned = n - gradient;
    return is_finite(turned) ? normalized(turned) : n;
}

float about_middle(float code) {
    const float x = 2 * code - 1;
    return std::abs(x) <= kNearMiddle ? 0 : x;
}

/// Tangent space as in glTF 2.0 (section 3.9.3) and MikkTSpace: x along u, made orthogonal to the normal; y
/// perpendicular to both, on the side of growing v; z the normal. `m` is the mean of the map's normals, shorter
/// than 1 where they differ.
Vec3 mapped(const Vec3& n, const TextureFrame& frame, const Rgb& m, float scale) {
    const Tangents t = tangents(frame, n);
    if (t.det == 0) return n;
    const Vec3 x = normalized(t.along_u), y = (t.det > 0 ? 1.0 : -1.0) * cross(n, x);
    const Vec3 turned =
        static_cast<double>(m.x * scale) * x + static_cast<double>(m.y * scale) * y + static_cast<double>(m.z) * n;
    const double length = norm(turned);
    return length > 0 && std::isfinite(length) ? turned / length : n;
}

/// Widens a lobe where the normals in the footprint differ, the more the shorter their mean: M. Toksvig,
/// "Mipmapping normal maps", Journal of Graphics Tools 10(3), 2005.
float widened(float exponent, const Rgb& mean_normal) {
    const float length = std::min(1.0f, norm(mean_normal) + kRounding);
    return exponent * length / (length + exponent * (1 - length));
}

/// Clouds cover this share of the surface, band by band.
void cover(const Rgb& share, const Rgb& albedo, Surface& s) {
    const Rgb left = Rgb{1, 1, 1} - share;
    s.diffuse = left * s.diffuse + share * albedo;
    s.specular = left * s.specular;
    s.emission = left * s.emission;
}

/// Turns a normal that points away from the viewer back to a grazing angle, in the plane of the two, so that the
/// surface stays lit from the same side.
Vec3 towards_viewer(const Vec3& n, const Vec3& v, const Vec3& geometric) {
    const double facing = dot(n, v);
    if (facing >= kMinFacing) return n;
    const Vec3 edge = n - facing * v;
    const double length = norm(edge);
    if (!(length > 1e-6)) return geometric;
    return (std::sqrt(1 - kMinFacing * kMinFacing) / length) * edge + kMinFacing * v;
}

}  // namespace

void apply_textures(const Tracer& tracer, const BodyPoses& at, const Hit& hit, const Vec3& ray_direction,
                    double width_m, Surface& s) noexcept {
    const Scene& scene = tracer.scene();
    const Material& m = *s.material;
    if (m.vertex_colours >= 0) s.diffuse = s.diffuse * tracer.vertex_colour(at, hit);
    if (!std::isfinite(hit.u) || !std::isfinite(hit.v)) return;
    const auto texture = [&](int index) {
        return index < 0 ? nullptr : &scene.textures[static_cast<std::size_t>(index)];
    };
    const Texture *const colour = texture(m.texture), *const glow = texture(m.emission_texture),
                         *const shine = texture(m.specular_texture), *const clouds = texture(m.cloud_texture),
                         *const normals = texture(m.normal_texture), *const heights = texture(m.height_texture);
    const auto has_levels = [](const Texture* t) { return t != nullptr && !t->coarser.empty(); };
    const bool filter = width_m > 0 && (has_levels(colour) || has_levels(glow) || has_levels(shine) ||
                                        has_levels(clouds) || has_levels(normals) || has_levels(heights));
    const bool turn = normals != nullptr || heights != nullptr;

    const TextureLayout layout = tracer.shape(static_cast<std::size_t>(hit.body)).properties().texture_layout;
    const TextureFrame frame = filter || turn ? tracer.texture_frame(at, hit) : TextureFrame{};
    const TextureFootprint seen = filter ? spot(frame, hit, ray_direction, width_m, layout) : TextureFootprint{};

    if (colour != nullptr) s.diffuse = s.diffuse * texture_lookup(*colour, hit.u, hit.v, seen, layout);
    if (glow != nullptr) s.emission = s.emission * texture_lookup(*glow, hit.u, hit.v, seen, layout);
    if (shine != nullptr) s.specular = s.specular * texture_lookup(*shine, hit.u, hit.v, seen, layout);
    if (clouds != nullptr) cover(texture_lookup(*clouds, hit.u, hit.v, seen, layout), m.cloud_albedo, s);
    if (!turn) return;

    const double side = hit.outside ? 1 : -1;  // maps describe the outer side
    Vec3 n = side * s.normal;
    if (heights != nullptr) {
        const TextureSlope slope = texture_slope(*heights, hit.u, hit.v, seen, layout);
        n = bumped(n, frame, {m.bump_height_m * slope.du, m.bump_height_m * slope.dv});
    }
    if (normals != nullptr) {
        const Rgb code = texture_lookup(*normals, hit.u, hit.v, seen, layout);
        const Rgb mean{about_middle(code.x), about_middle(code.y), about_middle(code.z)};
        n = mapped(n, frame, mean, m.normal_scale);
        if (is_lambert_or_phong(m)) s.exponent = widened(s.exponent, mean);
    }
    s.normal = towards_viewer(side * n, -ray_direction, hit.geometric_normal);
}

}  // namespace narpa
