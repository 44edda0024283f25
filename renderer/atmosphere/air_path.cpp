#include "renderer/atmosphere/air_path.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "renderer/atmosphere/fast_exp.h"
#include "renderer/atmosphere/gauss_legendre.h"

namespace narpa {
namespace {

/// Integrals of the Lagrange basis polynomials from 0 to each node, by the same rule scaled to that interval.
std::vector<float> integration_matrix(const Quadrature& q) {
    const std::size_t n = q.node.size();
    std::vector<float> matrix(n * n);
    for (std::size_t i = 0; i < n; ++i)
        for (std::size_t j = 0; j < n; ++j) {
            double sum = 0;
            for (std::size_t k = 0; k < n; ++k) {
                const double x = q.node[i] * q.node[k];
                double lagrange = 1;
                for (std::size_t m = 0; m < n; ++m)
                    if (m != j) lagrange *= (x - q.node[m]) / (q.node[j] - q.node[m]);
                sum += q.weight[k] * lagrange;
            }
            matrix[j * n + i] = static_cast<float>(q.node[i] * sum);
        }
    return matrix;
}

void insert(PanelEnds& ends, double t, double low, double high) {
    if (t > low && t < high && ends.n + 1 < PanelEnds::kMax) ends.t_m[ends.n++] = t;
}

/// Where a ray crosses the cylinder of the planet's shadow, behind it.
void insert_shadow_edges(PanelEnds& ends, const Vec3& o, const Vec3& d, const Vec3& s, double radius, double low,
                         double high) {
    const double od = dot(o, s), dd = dot(d, s);
    const Vec3 o_across = o - od * s, d_across = d - dd * s;
    const double a = dot(d_across, d_across), b = dot(o_across, d_across),
                 c = dot(o_across, o_across) - radius * radius;
    const double discriminant = b * b - a * c;
    if (!(discriminant > 0) || !(a > 1e-12)) return;
    const double root = std::sqrt(discriminant);
    for (const double t : {(-b - root) / a, (-b + root) / a})
        if (od + t * dd < 0) insert(ends, t, low, high);
}

}  // namespace

PanelRule::PanelRule(std::size_t nodes) : n(std::min(nodes, kMaxNodes)) {
    const Quadrature q = gauss_legendre(n);
    for (std::size_t i = 0; i < n; ++i) {
        node[i] = static_cast<float>(q.node[i]);
        weight[i] = static_cast<float>(q.weight[i]);
    }
    up_to = integration_matrix(q);
}

PanelEnds panel_ends(const Air& air, const Vec3& origin, const Vec3& direction, double range_m,
                     const Vec3* to_sun) noexcept {
    PanelEnds ends;
    const double top = air.top_radius_m(), ground = air.ground_radius_m();
    const double lowest_t = -dot(origin, direction);
    const Vec3 lowest = origin + lowest_t * direction;
    const double lowest2 = dot(lowest, lowest);
    if (!(lowest2 < top * top)) return ends;
    const double half = std::sqrt(top * top - lowest2);
    double low = std::max(0.0, lowest_t - half), high = std::min(range_m, lowest_t + half);
    const double floor = ground - kBelowGround_m;
    if (lowest2 < floor * floor) {
        const double inside = std::sqrt(floor * floor - lowest2);
        if (lowest_t - inside > 0)
            high = std::min(high, lowest_t - inside);
        else if (lowest_t + inside > 0)
            return ends;  // the ray starts below the ground
    }
    if (!(high > low)) return ends;
    ends.t_m[ends.n++] = low;
    insert(ends, lowest_t, low, high);
    if (to_sun != nullptr) insert_shadow_edges(ends, origin, direction, *to_sun, ground, low, high);
    ends.t_m[ends.n++] = high;
    for (std::size_t i = 1; i < ends.n; ++i)
        for (std::size_t k = i; k > 0 && ends.t_m[k] < ends.t_m[k - 1]; --k)
            std::swap(ends.t_m[k], ends.t_m[k - 1]);
    return ends;
}

void fill_panel(const Air& air, const PanelRule& rule, const Vec3& origin, const Vec3& direction, double from_m,
                double to_m, AirColumns& columns, AirPanel& panel) noexcept {
    const std::size_t n = rule.n;
    const double ground = air.ground_radius_m(), length = to_m - from_m;
    const double o2 = dot(origin, origin), along = dot(origin, direction);
    const bool rises = along + 0.5 * (from_m + to_m) > 0;
    panel.n = n;
    for (std::size_t i = 0; i < n; ++i) {
        // Quadratic spacing from the dense end.
        const float x = rises ? rule.node[i] : 1 - rule.node[i];
        const float share = rises ? x * x : 1 - x * x;
        const double t = from_m + length * static_cast<double>(share);
        panel.t_m[i] = static_cast<float>(t);
        panel.length_m[i] = static_cast<float>(length) * rule.weight[i] * 2 * x;
        panel.height_m[i] = std::max(0.0f, static_cast<float>(std::sqrt(o2 + t * (t + 2 * along)) - ground));
    }
    const AirDescription& d = air.description();
    const auto inv_gas = static_cast<float>(-1 / d.gas_height_m),
               inv_aerosol = static_cast<float>(-1 / d.aerosol_height_m);
    for (std::size_t i = 0; i < n; ++i) {
        panel.gas[i] = exp_of_negative(panel.height_m[i] * inv_gas);
        panel.aerosol[i] = exp_of_negative(panel.height_m[i] * inv_aerosol);
    }
    if (d.ozone_du > 0)
        for (std::size_t i = 0; i < n; ++i) panel.ozone[i] = Air::ozone_density(panel.height_m[i]);
    else
        panel.ozone.fill(0);
    AirColumns all{};
    for (std::size_t i = 0; i < n; ++i) {
        panel.gas_before[i] = columns.gas;
        panel.aerosol_before[i] = columns.aerosol;
        panel.ozone_before[i] = columns.ozone;
    }
    for (std::size_t j = 0; j < n; ++j) {
        const float length_of = panel.length_m[j] / rule.weight[j];
        const float g = panel.gas[j] * length_of, a = panel.aerosol[j] * length_of, o = panel.ozone[j] * length_of;
        const float* const row = &rule.up_to[j * n];
        for (std::size_t i = 0; i < n; ++i) {
            panel.gas_before[i] += row[i] * g;
            panel.aerosol_before[i] += row[i] * a;
            panel.ozone_before[i] += row[i] * o;
        }
        all.gas += rule.weight[j] * g;
        all.aerosol += rule.weight[j] * a;
        all.ozone += rule.weight[j] * o;
    }
    columns = {columns.gas + all.gas, columns.aerosol + all.aerosol, columns.ozone + all.ozone};
}

AirColumns columns_along(const Air& air, const PanelRule& rule, const Vec3& origin, const Vec3& direction,
                         double range_m) noexcept {
    AirColumns columns;
    AirPanel panel;
    const PanelEnds ends = panel_ends(air, origin, direction, range_m, nullptr);
    for (std::size_t k = 0; k + 1 < ends.n; ++k)
        fill_panel(air, rule, origin, direction, ends.t_m[k], ends.t_m[k + 1], columns, panel);
    return columns;
}

}  // namespace narpa
