// Writes ggx_table.cpp: the first-bounce reflectance of a rough GGX surface. The integrals are means over visible
// normals (E. Heitz, "Sampling the GGX Distribution of Visible Normals", JCGT 7, 2018): E = <G2/G1> is the albedo
// with F = 1, and <F G2/G1> / E a mean Fresnel reflectance, stored as the cosine at which Fresnel's equations give
// it.
#include <cstdio>
#include <numbers>
#include <span>

#include "renderer/material/fresnel.h"
#include "renderer/material/ggx_albedo.h"
#include "renderer/material/ggx_table.h"

namespace narpa::ggx_table {
namespace {

/// Points per axis of the integrals over normals and over the hemisphere.
constexpr int kNormals = 128, kMeanSteps = 2000;
/// Larger than the interpolation error, so that no energy is gained.
constexpr double kAlbedoMargin = 0.001, kCosineMargin = 0.985;

double index_of_node(int k) {
    const double root = static_cast<double>(k) / (kIndices - 1), x = std::max(1e-3, 0.5 * root * root);
    return (1 + x) / (1 - x);
}
double power_5(double x) {
    return x * x * x * x * x;
}

/// Means of F G2 / G1 over the visible normals, for each F that fresnel(cosine) returns.
template <std::size_t N, class Fresnel>
std::array<double, N> first_bounce(double alpha, double mu, Fresnel&& fresnel) {
    const auto smith = [&](double z) { return 0.5 * (std::sqrt(1 + alpha * alpha * (1 - z * z) / (z * z)) - 1); };
    const double sine = std::sqrt(1 - mu * mu), length = std::hypot(alpha * sine, mu);
    const double wx = alpha * sine / length, wz = mu / length, seen = 1 + smith(mu);
    std::array<double, N> sum{};
    for (int i = 0; i < kNormals; ++i) {
        const double cos_phi = std::cos(std::numbers::pi * (i + 0.5) / kNormals);
        for (int j = 0; j < kNormals; ++j) {
            const double z = (1 - (j + 0.5) / kNormals) * (1 + wz) - wz, r2 = std::max(0.0, 1 - z * z);
            const double hx = alpha * (std::sqrt(r2) * cos_phi + wx), hz = z + wz;
            const double y2 = alpha * alpha * r2 * (1 - cos_phi * cos_phi);
            const double h = std::sqrt(hx * hx + y2 + hz * hz), cosine = (hx * sine + hz * mu) / h;
            const double out = 2 * cosine * hz / h - mu;
            if (out <= 0) continue;
            const double weight = seen / (seen + smith(out));
            const std::array<double, N> f = fresnel(cosine);
            for (std::size_t k = 0; k < N; ++k) sum[k] += weight * f[k];
        }
    }
    for (double& s : sum) s /= kNormals * kNormals;
    return sum;
}

/// The cosine at which Fresnel's equations give this reflectance.
double cosine_at(double ior, double reflectance) {
    double low = 0, high = 1;
    for (int i = 0; i < 40; ++i) {
        const double middle = 0.5 * (low + high);
        (fresnel_dielectric(middle, ior) > reflectance ? low : high) = middle;
    }
    return low;
}

/// 2 * integral of f(mu) mu dmu, with nodes dense towards grazing.
template <class F>
double hemispherical(F&& f) {
    double sum = 0;
    for (int i = 0; i < kMeanSteps; ++i) {
        const double t = (i + 0.5) / kMeanSteps;
        sum += 4 * f(t * t) * t * t * t;
    }
    return sum / kMeanSteps;
}

void set_cosines(Tables& t, int i, int j, double alpha, double mu) {
    // Means for each index, for Schlick's power, and E.
    const auto means = first_bounce<kIndices + 2>(alpha, mu, [](double c) {
        std::array<double, kIndices + 2> f;
        for (int k = 0; k < kIndices; ++k) f[static_cast<std::size_t>(k)] = fresnel_dielectric(c, index_of_node(k));
        f[kIndices] = power_5(1 - c), f[kIndices + 1] = 1;
        return f;
    });
    for (int k = 0; k <= kIndices; ++k) {
        const double mean = means[static_cast<std::size_t>(k)] / means[kIndices + 1];
        const double c = k < kIndices ? cosine_at(index_of_node(k), mean) : 1 - std::pow(mean, 0.2);
        t.cosine[static_cast<std::size_t>(k)].node(i, j) = static_cast<float>(kCosineMargin * c / (mu + alpha));
    }
}

double mean_reflected(const Tables& t, int k, double roughness) {
    const double mean = hemispherical([&](double mu) {
        const double c =
            std::min(1.0, t.cosine[static_cast<std::size_t>(k)].at(roughness, mu) * (mu + roughness * roughness));
        return t.albedo.at(roughness, mu) *
               (k < kIndices ? fresnel_dielectric(c, index_of_node(k)) : power_5(1 - c));
    });
    return k < kIndices ? mean / mean_fresnel({index_of_node(k)}) : mean;
}

Tables computed() {
    Tables t;
    t.albedo.for_each_node([&](int i, int j, double alpha, double mu) {
        const auto [e] = first_bounce<1>(alpha, mu, [](double) { return std::array{1.0}; });
        t.albedo.node(i, j) = static_cast<float>(std::min(1.0, e + kAlbedoMargin));
    });
    t.cosine[0].for_each_node([&](int i, int j, double alpha, double mu) { set_cosines(t, i, j, alpha, mu); });
    for (std::size_t i = 0; i < kRoughnessNodes; ++i) {
        const double roughness = static_cast<double>(i) / (kRoughnessNodes - 1);
        t.mean_albedo[i] = static_cast<float>(hemispherical([&](double mu) { return t.albedo.at(roughness, mu); }));
    }
    for (int k = 0; k <= kIndices; ++k)
        for (std::size_t i = 0; i < kCosineRoughnessNodes; ++i)
            t.mean_reflected[static_cast<std::size_t>(k)][i] =
                static_cast<float>(mean_reflected(t, k, static_cast<double>(i) / (kCosineRoughnessNodes - 1)));
    return t;
}

void write(std::span<const float> values) {
    for (const float v : values) std::printf("%.4ef, ", static_cast<double>(v));
    std::printf("\n");
}

}  // namespace
}  // namespace narpa::ggx_table

int main() {
    const narpa::ggx_table::Tables t = narpa::ggx_table::computed();
    std::printf(
        "#include \"renderer/material/ggx_table.h\"\n\nconst narpa::ggx_table::Tables "
        "narpa::ggx_table::kTables = {\n");
    // Inner braces are omitted.
    narpa::ggx_table::write(t.albedo.values);
    narpa::ggx_table::write(t.mean_albedo);
    for (const auto& table : t.cosine) narpa::ggx_table::write(table.values);
    for (const auto& row : t.mean_reflected) narpa::ggx_table::write(row);
    std::printf("};\n");
}
