#include "scenes/generate/shapes.h"

#include <algorithm>

namespace narpa::scenes {
namespace {

/// Angle in radians between two steps of a profile.
double bend(const ProfilePoint& p, const ProfilePoint& q, const ProfilePoint& r) {
    const double ax = q.a - p.a, ay = q.r - p.r, bx = r.a - q.a, by = r.r - q.r;
    return std::abs(std::atan2(ax * by - ay * bx, ax * bx + ay * by));
}

/// Turns a profile about the x axis; uv(angle, point of the profile).
void revolve(Mesh& mesh, const Rigid3& T, const std::vector<ProfilePoint>& profile, int segments,
             const Relief& relief, const std::function<Uv(double, std::size_t)>& uv) {
    const auto angle = [segments](int i) { return 2 * kPi * i / segments; };
    for (std::size_t start = 0; start + 1 < profile.size();) {
        std::size_t end = start + 1;
        while (end + 1 < profile.size() && bend(profile[end - 1], profile[end], profile[end + 1]) < 35 * kPi / 180)
            ++end;
        mesh.grid(
            segments, static_cast<int>(end - start), true,
            [&](int i, int j) {
                const ProfilePoint& p = profile[start + static_cast<std::size_t>(j)];
                const double r = p.r > 0 && relief ? p.r + relief(angle(i), p.a) : p.r;
                return T * Vec3{p.a, r * std::cos(angle(i)), r * std::sin(angle(i))};
            },
            [&](int i, int j) { return uv(angle(i), start + static_cast<std::size_t>(j)); });
        start = end;
    }
}

}  // namespace

Rigid3 frame_along(const Vec3& origin, const Vec3& x_axis, const Vec3& up) {
    const Vec3 x = normalized(x_axis);
    Vec3 y = cross(up, x);
    if (norm(y) < 1e-6) y = cross(Vec3{1, 0, 0}, x);
    if (norm(y) < 1e-6) y = cross(Vec3{0, 1, 0}, x);
    y = normalized(y);
    return {quat_from_columns(x, y, cross(x, y)), origin};
}

void box(Mesh& mesh, const Rigid3& T, const Vec3& half, double bevel) {
    // Corner `s`, of signs, of the face that points along `axis`.
    const auto corner = [&](int axis, const Vec3& s) {
        Vec3 p = s * (half - Vec3{bevel, bevel, bevel});
        p[axis] = s[axis] * half[axis];
        return T * p;
    };
    for (int a = 0; a < 3; ++a) {
        const int b = (a + 1) % 3, c = (a + 2) % 3;
        const auto sign = [&](int sa, int sb, int sc) {
            Vec3 s;
            s[a] = sa, s[b] = sb, s[c] = sc;
            return s;
        };
        for (const int s : {-1, 1}) {
            mesh.polygon({corner(a, sign(s, -1, -1)), corner(a, sign(s, 1, -1)), corner(a, sign(s, 1, 1)),
                          corner(a, sign(s, -1, 1))},
                         T.t);
            for (const int t : {-1, 1})
                mesh.polygon({corner(a, sign(s, t, -1)), corner(a, sign(s, t, 1)), corner(b, sign(s, t, 1)),
                              corner(b, sign(s, t, -1))},
                             T.t);
        }
    }
    for (int i = 0; i < 8; ++i) {
        const Vec3 s{i & 1 ? 1.0 : -1.0, i & 2 ? 1.0 : -1.0, i & 4 ? 1.0 : -1.0};
        mesh.polygon({corner(0, s), corner(1, s), corner(2, s)}, T.t);
    }
}

void lathe(Mesh& mesh, const Rigid3& T, const std::vector<ProfilePoint>& profile, int segments,
           double metres_per_tile, const Relief& relief) {
    double r_max = 0, length = 0;
    std::vector<double> along(profile.size());
    for (std::size_t k = 0; k < profile.size(); ++k) {
        r_max = std::max(r_max, profile[k].r);
        if (k > 0) length += std::hypot(profile[k].a - profile[k - 1].a, profile[k].r - profile[k - 1].r);
        along[k] = length;
    }
    revolve(mesh, T, profile, segments, relief, [&](double angle, std::size_t k) {
        return Uv{angle * r_max / metres_per_tile, along[k] / metres_per_tile};
    });
}

void lathe_facing(Mesh& mesh, const Rigid3& T, const std::vector<ProfilePoint>& profile, int segments,
                  double metres_per_tile) {
    revolve(mesh, T, profile, segments, {}, [&](double angle, std::size_t k) {
        const double s = profile[k].r / metres_per_tile;
        return Uv{0.5 + s * std::cos(angle), 0.5 + s * std::sin(angle)};
    });
}

std::vector<ProfilePoint> refined(const std::vector<ProfilePoint>& profile, double step) {
    std::vector<ProfilePoint> out{profile.front()};
    for (std::size_t k = 1; k < profile.size(); ++k) {
        const ProfilePoint p = profile[k - 1], q = profile[k];
        const int n = std::max(1, static_cast<int>(std::ceil(std::hypot(q.a - p.a, q.r - p.r) / step)));
        for (int i = 1; i <= n; ++i) out.push_back({p.a + (q.a - p.a) * i / n, p.r + (q.r - p.r) * i / n});
    }
    return out;
}

void tube(Mesh& mesh, const Vec3& p, const Vec3& q, double radius, int segments) {
    const double length = norm(q - p);
    lathe(mesh, frame_along(p, q - p), {{0, 0}, {0, radius}, {length, radius}, {length, 0}}, segments);
}

void ball(Mesh& mesh, const Vec3& centre, double radius, int segments) {
    std::vector<ProfilePoint> profile;
    const int n = segments / 2;
    for (int i = 0; i <= n; ++i)
        profile.push_back({-radius * std::cos(kPi * i / n), i == 0 || i == n ? 0 : radius * std::sin(kPi * i / n)});
    lathe(mesh, {{}, centre}, profile, segments);
}

void pipe(Mesh& mesh, const std::vector<Vec3>& points, double radius, int segments) {
    for (std::size_t k = 1; k < points.size(); ++k) {
        tube(mesh, points[k - 1], points[k], radius, segments);
        if (k + 1 < points.size()) ball(mesh, points[k], radius * 1.02, 8);
    }
}

void plate(Mesh& mesh, const Plate& p) {
    const auto inset = [](double x, double bevel) { return bevel + x * (1 - 2 * bevel); };
    const auto top = [&](double u, double v) { return p.shape(inset(u, p.bevel_u), inset(v, p.bevel_v), 1); };
    const double chamfer = 0.65;  // height at which the chamfer meets the side
    const auto step = [](int i, int n) { return static_cast<double>(i) / n; };
    mesh.grid(
        p.nu, p.nv, false, [&](int i, int j) { return top(step(i, p.nu), step(j, p.nv)); },
        [&](int i, int j) { return p.uv(inset(step(i, p.nu), p.bevel_u), inset(step(j, p.nv), p.bevel_v)); });

    // The rim, counter-clockwise seen from the top: sides 0 to 3 of n(side) steps.
    const auto n = [&](int side) { return side % 2 == 0 ? p.nu : p.nv; };
    const auto rim = [&](int side, int i) {
        const double s = step(side < 2 ? i : n(side) - i, n(side));
        return side % 2 == 0 ? Uv{s, side == 0 ? 0.0 : 1.0} : Uv{side == 1 ? 1.0 : 0.0, s};
    };
    const auto rim_uv = [&](int side, int i) { return p.uv(rim(side, i)[0], rim(side, i)[1]); };
    const auto rim_point = [&](int side, int i, double w) { return p.shape(rim(side, i)[0], rim(side, i)[1], w); };
    for (int side = 0; side < 4; ++side) {
        const auto uv = [&](int i, int) { return rim_uv(side, i); };
        mesh.grid(
            n(side), 1, false, [&](int i, int j) { return rim_point(side, i, j == 0 ? 0 : chamfer); }, uv);
        mesh.grid(
            n(side), 1, false,
            [&](int i, int j) {
                return j == 0 ? rim_point(side, i, chamfer) : top(rim(side, i)[0], rim(side, i)[1]);
            },
            uv);
    }
    if (!p.underside.empty()) mesh.material(p.underside);
    const Vec3 centre = p.shape(0.5, 0.5, 0);
    for (int side = 0; side < 4; ++side)
        mesh.grid(
            n(side), 1, false, [&](int i, int j) { return j == 0 ? centre : rim_point(side, i, 0); },
            [&](int i, int j) { return j == 0 ? p.uv(0.5, 0.5) : rim_uv(side, i); });
}

void truss(Mesh& mesh, const Vec3& p, const Vec3& q, const Vec3& up, double width, int bays, double tube_radius) {
    const Rigid3 T = frame_along(p, q - p, up);
    const double bay = norm(q - p) / bays, h = 0.5 * width;
    const std::array<std::array<double, 2>, 4> corners{{{-h, -h}, {h, -h}, {h, h}, {-h, h}}};
    const auto node = [&](int k, std::size_t c) { return T * Vec3{k * bay, corners[c % 4][0], corners[c % 4][1]}; };
    for (std::size_t c = 0; c < 4; ++c) {
        tube(mesh, node(0, c), node(bays, c), tube_radius, 8);
        for (int k = 0; k <= bays; ++k) tube(mesh, node(k, c), node(k, c + 1), 0.8 * tube_radius, 6);
        for (int k = 0; k < bays; ++k)
            tube(mesh, node(k, c + static_cast<std::size_t>(k % 2)),
                 node(k + 1, c + static_cast<std::size_t>((k + 1) % 2)), 0.7 * tube_radius, 6);
    }
}

void dish(Mesh& mesh, const Rigid3& T, double diameter, const std::string& face, const std::string& structure,
          int segments) {
    const double r = 0.5 * diameter, depth = 0.3 * r, wall = 0.02;
    const int rings = segments * 5 / 18;
    const auto bowl = [&](int i) {
        const double part = static_cast<double>(i) / rings;
        return ProfilePoint{depth * part * part, r * part};
    };
    std::vector<ProfilePoint> profile;  // the back from the axis to the rim, then the bowl to the axis
    for (int i = 0; i <= rings; ++i) profile.push_back({bowl(i).a - wall, bowl(i).r});
    for (int i = rings; i >= 0; --i) profile.push_back(bowl(i));
    mesh.material(face);
    lathe(mesh, T, profile, segments);
    mesh.material(structure);
    const int around = segments * 4 / 9;
    const Vec3 focus{0.9 * r, 0, 0};
    lathe(mesh, T * Rigid3{{}, focus}, {{-0.06, 0}, {-0.06, 0.05}, {0.06, 0.09}, {0.06, 0}}, around);
    for (int i = 0; i < 3; ++i) {
        const double angle = 2 * kPi * i / 3;
        tube(mesh, T * Vec3{0.64 * depth, 0.8 * r * std::cos(angle), 0.8 * r * std::sin(angle)}, T * focus, 0.012,
             segments / 6);
    }
    lathe(mesh, T, {{-0.35, 0}, {-0.35, 0.12}, {0.005, 0.12}, {0.005, 0}}, around);
}

void handrail(Mesh& mesh, const Rigid3& T, double length) {
    const double height = 0.075, radius = 0.016, h = 0.5 * length;
    pipe(mesh, {T * Vec3{-h, 0, -0.02}, T * Vec3{-h, 0, height}, T * Vec3{h, 0, height}, T * Vec3{h, 0, -0.02}},
         radius, 6);
}

}  // namespace narpa::scenes
