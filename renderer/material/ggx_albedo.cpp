#include "renderer/material/ggx_albedo.h"

#include "renderer/material/fresnel.h"
#include "renderer/material/ggx_table.h"

namespace narpa {
namespace {

using namespace ggx_table;

TablePlace index_place(double ior) {
    return place(std::sqrt(2 * std::max(0.0, (ior - 1) / (ior + 1))), kIndices);
}
}  // namespace

GgxAlbedo::GgxAlbedo(double roughness) noexcept : roughness_(roughness), alpha_(roughness * roughness) {}

double GgxAlbedo::at(double mu) const noexcept {
    return kTables.albedo.at(roughness_, mu);
}

double GgxAlbedo::mean() const noexcept {
    return between(kTables.mean_albedo.data(), place(roughness_, kRoughnessNodes));
}

double GgxAlbedo::dielectric(Interface i, double mu) const noexcept {
    const auto cosine = [&](int index) {
        return std::min(1.0, kTables.cosine[static_cast<std::size_t>(index)].at(roughness_, mu) * (mu + alpha_));
    };
    if (i.schlick) return at(mu) * schlick(normal_reflectance(i.ior), cosine(kIndices));
    const TablePlace n = index_place(i.ior);
    const double c = cosine(n.node) * (1 - n.beyond) + cosine(n.node + 1) * n.beyond;
    return at(mu) * fresnel_dielectric(c, i.ior);
}

double GgxAlbedo::mean_schlick_power() const noexcept {
    return between(kTables.mean_reflected[kIndices].data(), place(roughness_, kCosineRoughnessNodes));
}

double GgxAlbedo::dielectric_mean(Interface i) const noexcept {
    if (i.schlick) {
        const double r0 = normal_reflectance(i.ior);
        return r0 * mean() + (1 - r0) * mean_schlick_power();
    }
    const TablePlace n = index_place(i.ior), row = place(roughness_, kCosineRoughnessNodes);
    const auto reflected = [&](int index) {
        return between(kTables.mean_reflected[static_cast<std::size_t>(index)].data(), row);
    };
    return mean_fresnel(i) * (reflected(n.node) * (1 - n.beyond) + reflected(n.node + 1) * n.beyond);
}

}  // namespace narpa
