#include "renderer/ephemeris/iau_rotation.h"

#include <erfa.h>

#include <cmath>
#include <numbers>

#include "renderer/ephemeris/time_scales.h"

namespace narpa {

namespace {

constexpr double kDegree_rad = std::numbers::pi / 180;

double sin_deg(double x) {
    return std::sin(std::fmod(x, 360.0) * kDegree_rad);
}
double cos_deg(double x) {
    return std::cos(std::fmod(x, 360.0) * kDegree_rad);
}

/// Right ascension and declination of the pole, and the angle of the prime meridian; degrees.
struct Elements {
    double ra = 0, dec = 0, w = 0;
};

/// Linear in time: at J2000, a century or a day.
struct Plain {
    std::string_view name;
    double ra, ra_century, dec, dec_century, w, w_day;
};
constexpr Plain kPlain[] = {
    {"sun", 286.13, 0, 63.87, 0, 84.176, 14.1844},
    {"mercury", 281.0103, -0.0328, 61.4155, -0.0049, 329.5988, 6.1385108},
    {"venus", 272.76, 0, 67.16, 0, 160.20, -1.4813688},
    {"jupiter", 268.056595, -0.006499, 64.495303, 0.002413, 284.95, 870.5360000},
    {"saturn", 40.589, -0.036, 83.537, -0.004, 38.90, 810.7939024},
    {"uranus", 257.311, 0, -15.175, 0, 203.81, -501.1600928},
    {"neptune", 299.36, 0, 43.46, 0, 249.978, 541.1397757},
    {"pluto", 132.993, 0, -6.163, 0, 302.695, 56.3625225},
    {"ceres", 291.418, 0, 66.764, 0, 170.650, 952.1532},
    {"vesta", 309.031, 0, 42.235, 0, 285.39, 1617.3329428},
    {"eros", 11.35, 0, 17.22, 0, 326.07, 1639.38864745},
    {"itokawa", 90.53, 0, -66.30, 0, 0, 712.143},
};

Elements mars(double d, double T) {
    return {
        317.269202 - 0.10927547 * T + 0.000068 * sin_deg(198.991226 + 19139.4819985 * T) +
            0.000238 * sin_deg(226.292679 + 38280.8511281 * T) +
            0.000052 * sin_deg(249.663391 + 57420.7251593 * T) +
            0.000009 * sin_deg(266.183510 + 76560.6367950 * T) + 0.419057 * sin_deg(79.398797 + 0.5042615 * T),
        54.432516 - 0.05827105 * T + 0.000051 * cos_deg(122.433576 + 19139.9407476 * T) +
            0.000141 * cos_deg(43.058401 + 38280.8753272 * T) + 0.000031 * cos_deg(57.663379 + 57420.7517205 * T) +
            0.000005 * cos_deg(79.476401 + 76560.6495004 * T) + 1.591274 * cos_deg(166.325722 + 0.5042615 * T),
        176.049863 + 350.891982443297 * d + 0.000145 * sin_deg(129.071773 + 19140.0328244 * T) +
            0.000157 * sin_deg(36.352167 + 38281.0473591 * T) + 0.000040 * sin_deg(56.668646 + 57420.9295360 * T) +
            0.000001 * sin_deg(67.364003 + 76560.2552215 * T) + 0.000104 * sin_deg(104.792680 + 95700.4387578 * T) +
            0.584542 * sin_deg(95.391654 + 0.5042615 * T)};
}

Elements moon(double d, double T) {
    const double e1 = 125.045 - 0.0529921 * d, e2 = 250.089 - 0.1059842 * d, e3 = 260.008 + 13.0120009 * d,
                 e4 = 176.625 + 13.3407154 * d, e5 = 357.529 + 0.9856003 * d, e6 = 311.589 + 26.4057084 * d,
                 e7 = 134.963 + 13.0649930 * d, e8 = 276.617 + 0.3287146 * d, e9 = 34.226 + 1.7484877 * d,
                 e10 = 15.134 - 0.1589763 * d, e11 = 119.743 + 0.0036096 * d, e12 = 239.961 + 0.1643573 * d,
                 e13 = 25.053 + 12.9590088 * d;
    return {269.9949 + 0.0031 * T - 3.8787 * sin_deg(e1) - 0.1204 * sin_deg(e2) + 0.0700 * sin_deg(e3) -
                0.0172 * sin_deg(e4) + 0.0072 * sin_deg(e6) - 0.0052 * sin_deg(e10) + 0.0043 * sin_deg(e13),
            66.5392 + 0.0130 * T + 1.5419 * cos_deg(e1) + 0.0239 * cos_deg(e2) - 0.0278 * cos_deg(e3) +
                0.0068 * cos_deg(e4) - 0.0029 * cos_deg(e6) + 0.0009 * cos_deg(e7) + 0.0008 * cos_deg(e10) -
                0.0009 * cos_deg(e13),
            38.3213 + 13.17635815 * d - 1.4e-12 * d * d + 3.5610 * sin_deg(e1) + 0.1208 * sin_deg(e2) -
                0.0642 * sin_deg(e3) + 0.0158 * sin_deg(e4) + 0.0252 * sin_deg(e5) - 0.0066 * sin_deg(e6) -
                0.0047 * sin_deg(e7) - 0.0046 * sin_deg(e8) + 0.0028 * sin_deg(e9) + 0.0052 * sin_deg(e10) +
                0.0040 * sin_deg(e11) + 0.0019 * sin_deg(e12) - 0.0044 * sin_deg(e13)};
}

Quat about(int axis, double degrees) {
    const double half = 0.5 * std::fmod(degrees, 720.0) * kDegree_rad;
    Quat q{std::cos(half), 0, 0, 0};
    (axis == 0 ? q.x : q.z) = std::sin(half);
    return q;
}

Quat attitude_from(const Elements& e) {
    return about(2, e.ra + 90) * about(0, 90 - e.dec) * about(2, e.w);
}

Quat earth(const TimeScales& t) {
    double m[3][3];  // celestial to terrestrial
    eraC2t06a(t.tt.days, t.tt.fraction, t.utc.days, t.utc.fraction, 0, 0, m);
    return quat_from_columns({m[0][0], m[0][1], m[0][2]}, {m[1][0], m[1][1], m[1][2]}, {m[2][0], m[2][1], m[2][2]});
}

}  // namespace

std::optional<Quat> q_icrs_body(std::string_view body, std::int64_t unix_ns) {
    const TimeScales t = time_scales(unix_ns);
    const double d = t.days_since_j2000(), T = d / 36525;
    if (body == "earth") return earth(t);
    if (body == "moon") return attitude_from(moon(d, T));
    if (body == "mars") return attitude_from(mars(d, T));
    for (const Plain& p : kPlain)
        if (p.name == body)
            return attitude_from({p.ra + p.ra_century * T, p.dec + p.dec_century * T, p.w + p.w_day * d});
    return std::nullopt;
}

std::optional<BodyRotation> body_rotation_of(std::string_view body, std::int64_t unix_ns) {
    constexpr std::int64_t kMinute_ns = 60'000'000'000;
    const auto now = q_icrs_body(body, unix_ns), before = q_icrs_body(body, unix_ns - kMinute_ns),
               after = q_icrs_body(body, unix_ns + kMinute_ns);
    if (!now) return std::nullopt;
    return BodyRotation{*now, rotation_vector(conjugate(*before) * *after) / 120.0};
}

}  // namespace narpa
