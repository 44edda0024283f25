#include "renderer/material/ggx_albedo.h"

#include <algorithm>
#include <cmath>

#include "renderer/material/fresnel.h"

namespace narpa {
namespace {

using namespace ggx_table;

/// A place between two nodes of an even axis.
struct Place {
    int node;
    double beyond;
};
Place place(double where, int nodes) {
    const double x = std::clamp(where, 0.0, 1.0) * (nodes - 1);
    const int node = std::min(static_cast<int>(x), nodes - 2);
    return {node, x - node};
}
double between(const float* values, const Place& at) {
    return static_cast<double>(values[at.node]) * (1 - at.beyond) +
           static_cast<double>(values[at.node + 1]) * at.beyond;
}
double between(const float* rows, int columns, const Place& row, const Place& column) {
    return between(rows + row.node * columns, column) * (1 - row.beyond) +
           between(rows + (row.node + 1) * columns, column) * row.beyond;
}
double mu_axis(double mu, double alpha) {
    return std::sqrt(mu * (1 + alpha) / (mu + alpha));
}

/// Even in the root, so linear in sqrt((n - 1) / (n + 1)) between nodes.
Place index_place(double ior) {
    return place(std::sqrt(2 * std::max(0.0, (ior - 1) / (ior + 1))), kIndexNodes);
}

}  // namespace

GgxAlbedo::GgxAlbedo(double roughness) noexcept : roughness_(roughness), alpha_(roughness * roughness) {}

double GgxAlbedo::at(double mu) const noexcept {
    return between(kAlbedo, kMuNodes, place(roughness_, kRoughnessNodes), place(mu_axis(mu, alpha_), kMuNodes));
}

double GgxAlbedo::mean() const noexcept {
    return between(kMeanAlbedo, place(roughness_, kRoughnessNodes));
}

double GgxAlbedo::dielectric(Interface i, double mu) const noexcept {
    const Place row = place(roughness_, kCosineRoughnessNodes), column = place(mu_axis(mu, alpha_), kCosineMuNodes);
    const auto cosine = [&](int index) {
        const float* table = kCosine + index * kCosineRoughnessNodes * kCosineMuNodes;
        return std::min(1.0, between(table, kCosineMuNodes, row, column) * (mu + alpha_));
    };
    if (i.schlick) return at(mu) * schlick(normal_reflectance(i.ior), cosine(kIndexNodes));
    const Place n = index_place(i.ior);
    const double c = cosine(n.node) * (1 - n.beyond) + cosine(n.node + 1) * n.beyond;
    return at(mu) * fresnel_dielectric(c, i.ior);
}

double GgxAlbedo::mean_schlick_power() const noexcept {
    return between(kMeanReflected + kIndexNodes * kCosineRoughnessNodes, place(roughness_, kCosineRoughnessNodes));
}

double GgxAlbedo::dielectric_mean(Interface i) const noexcept {
    if (i.schlick) {
        const double r0 = normal_reflectance(i.ior);
        return r0 * mean() + (1 - r0) * mean_schlick_power();
    }
    return mean_fresnel(i) * between(kMeanReflected, kCosineRoughnessNodes, index_place(i.ior),
                                     place(roughness_, kCosineRoughnessNodes));
}

double mean_fresnel(GgxAlbedo::Interface i) noexcept {
    if (i.schlick) return (1 + 20 * normal_reflectance(i.ior)) / 21;
    return (i.ior - 1) / (4.08567 + 1.00071 * i.ior);
}

}  // namespace narpa
