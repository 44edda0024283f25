#include <charconv>
#include <fstream>
#include <stdexcept>

#include "scenes/generate/scenes.h"
#include "scenes/generate/shapes.h"

namespace narpa::scenes {
namespace {

/// A value and its derivative in time.
struct Dual {
    double v = 0, d = 0;
    friend Dual operator+(Dual a, Dual b) { return {a.v + b.v, a.d + b.d}; }
    friend Dual operator*(Dual a, Dual b) { return {a.v * b.v, a.d * b.v + a.v * b.d}; }
    friend Dual operator*(double k, Dual a) { return {k * a.v, k * a.d}; }
};

/// Where a leg of the approach starts or ends: acceleration is zero there.
struct Knot {
    double t_s, x_m, speed_m_s;
};

/// The fifth-order polynomial from one knot to the next.
Dual leg(const Knot& p, const Knot& q, double t_s) {
    const double T = q.t_s - p.t_s, s = (t_s - p.t_s) / T;
    const double rise = q.x_m - p.x_m - p.speed_m_s * T, turn = (q.speed_m_s - p.speed_m_s) * T;
    const double c3 = 10 * rise - 4 * turn, c4 = -15 * rise + 7 * turn, c5 = 6 * rise - 3 * turn;
    return {p.x_m + s * (p.speed_m_s * T + s * s * (c3 + s * (c4 + s * c5))),
            p.speed_m_s + s * s * (3 * c3 + s * (4 * c4 + s * 5 * c5)) / T};
}

/// Distance along the port's axis: down to the hold at 10 m, hold, to 0.6 m, then on at 7.5 cm/s to contact.
Dual distance(double t_s) {
    static constexpr Knot kKnots[] = {{0, 60, -2.0}, {25, 10, 0}, {30, 10, 0}, {52, 0.6, -0.075}, {60, 0, -0.075}};
    int k = 0;
    while (k < 3 && t_s > kKnots[k + 1].t_s) ++k;
    return leg(kKnots[k], kKnots[k + 1], t_s);
}

/// 1 at the start, 0 from `end` on.
Dual fade(double t_s, double end_s) {
    return t_s >= end_s ? Dual{0, 0} : leg({0, 1, 0}, {end_s, 0, 0}, t_s);
}
Dual wave(double t_s, double period_s, double phase) {
    const double w = 2 * kPi / period_s;
    return {std::sin(w * t_s + phase), w * std::cos(w * t_s + phase)};
}

/// Body rate of exp(phi) for a turning vector phi: the right Jacobian of SO(3) times its derivative.
Vec3 rate_of(const Vec3& phi, const Vec3& phi_rate) {
    const double a2 = dot(phi, phi), a = std::sqrt(a2);
    const double b = a < 1e-4 ? 0.5 - a2 / 24 : (1 - std::cos(a)) / a2;
    const double c = a < 1e-4 ? 1.0 / 6 - a2 / 120 : (a - std::sin(a)) / (a2 * a);
    const Vec3 turned = cross(phi, phi_rate);
    return phi_rate - b * turned + c * cross(phi, turned);
}

std::string fixed(double x) {
    char text[40];
    return {text, std::to_chars(text, text + sizeof text, x == 0 ? 0.0 : x, std::chars_format::fixed, 10).ptr};
}

}  // namespace

Motion approach_at(double t_s) {
    constexpr double kDegree = kPi / 180;
    const Dual wander = fade(t_s, 52);  // what is left of the controller's limit cycle
    const Dual x = distance(t_s);
    const Dual y = 3.2 * fade(t_s, 27) + 0.12 * (wander * wave(t_s, 21, 0.4));
    const Dual z = -2.1 * fade(t_s, 25) + 0.10 * (wander * wave(t_s, 17, 2.0));
    const Dual turn[3] = {(4.0 * kDegree) * fade(t_s, 40) + (0.8 * kDegree) * (wander * wave(t_s, 13, 0.0)),
                          (-2.5 * kDegree) * fade(t_s, 34) + (0.6 * kDegree) * (wander * wave(t_s, 11, 1.0)),
                          (3.0 * kDegree) * fade(t_s, 30) + (0.6 * kDegree) * (wander * wave(t_s, 15, 2.5))};
    const Vec3 phi{turn[0].v, turn[1].v, turn[2].v}, phi_rate{turn[0].d, turn[1].d, turn[2].d};
    const Quat facing_the_port{0, 0, 0, 1};  // half a turn about z: the chaser's x is the station's -x
    return {{facing_the_port * exp_rotation(phi), {x.v, y.v, z.v}}, {x.d, y.d, z.d}, rate_of(phi, phi_rate)};
}

void write_approach(const std::string& path) {
    std::string text = "t_s,body,x_m,y_m,z_m,qw,qx,qy,qz,vx_m_s,vy_m_s,vz_m_s,wx_rad_s,wy_rad_s,wz_rad_s\n";
    const int rows = static_cast<int>(std::lround(kApproachDuration_s / kApproachStep_s)) + 1;
    for (int row = 0; row < rows; ++row) {
        const double t_s = row / std::round(1 / kApproachStep_s);
        const Motion m = approach_at(t_s);
        const Quat& q = m.T_world_body.q;
        const Vec3 &p = m.T_world_body.t, &v = m.velocity_m_s, &w = m.rate_rad_s;
        char time[16];
        text.append(time, std::to_chars(time, time + sizeof time, t_s, std::chars_format::fixed, 1).ptr);
        text += ",chaser";
        for (const double number : {p.x, p.y, p.z, q.w, q.x, q.y, q.z, v.x, v.y, v.z, w.x, w.y, w.z})
            text += ',' + fixed(number);
        text += '\n';
    }
    std::ofstream file(path, std::ios::binary);
    file << text;
    if (!file.flush()) throw std::runtime_error(path + ": cannot be written");
}

}  // namespace narpa::scenes
