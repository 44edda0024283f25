#include "base/pose.h"
#include "base/constants.h"

#include <gtest/gtest.h>

#include <random>

#include "base/pose_path.h"
#include "tests/support/oracle.h"

namespace narpa {
namespace {

/// Rotation angles where formulas break: none, tiny, ordinary, next to half a turn.
constexpr double kAngles[] = {0,   1e-150, 1e-16, 1e-12,      1e-9,        1e-8, 1e-4,
                              0.3, 1.5,    3.0,   kPi - 1e-6, kPi - 1e-12, kPi};

class Seeded {
public:
    explicit Seeded(std::uint64_t seed) : random_(seed) {}
    double number(double low, double high) { return std::uniform_real_distribution<double>(low, high)(random_); }
    Vec3 vector(double size) { return {number(-size, size), number(-size, size), number(-size, size)}; }
    Vec3 axis() {
        Vec3 v = vector(1);
        while (norm(v) < 0.1) v = vector(1);
        return normalized(v);
    }
    Quat attitude() { return exp_rotation(number(0, kPi) * axis()); }
    Rigid3 pose(double size) { return {attitude(), vector(size)}; }

private:
    std::mt19937_64 random_;
};

double distance(const Quat& a, const Quat& b) {
    const Quat d{a.w - b.w, a.x - b.x, a.y - b.y, a.z - b.z};
    return norm(d);
}
/// Sign-free: q and -q are the same rotation. NaN is far from everything.
::testing::AssertionResult is_near(const Quat& a, const Quat& b, double tolerance) {
    const double d = std::min(distance(a, b), distance(a, -b));
    if (d <= tolerance) return ::testing::AssertionSuccess();
    return ::testing::AssertionFailure() << "(" << a.w << " " << a.x << " " << a.y << " " << a.z << ") is " << d
                                         << " from (" << b.w << " " << b.x << " " << b.y << " " << b.z << ")";
}
::testing::AssertionResult is_near(const Vec3& a, const Vec3& b, double tolerance) {
    if (norm(a - b) <= tolerance) return ::testing::AssertionSuccess();
    return ::testing::AssertionFailure() << "(" << a.x << " " << a.y << " " << a.z << ") is " << norm(a - b)
                                         << " from (" << b.x << " " << b.y << " " << b.z << ")";
}

TEST(Quat, QuarterTurnAboutZTakesXToY) {
    const Quat q{std::sqrt(0.5), 0, 0, std::sqrt(0.5)};
    EXPECT_TRUE(is_near(q * Vec3{1, 0, 0}, Vec3{0, 1, 0}, 1e-15));
    EXPECT_TRUE(is_near(q * Vec3{0, 1, 0}, Vec3{-1, 0, 0}, 1e-15));
}

TEST(Quat, ProductTurnsInTurn) {
    Seeded s(1);
    for (int i = 0; i < 1000; ++i) {
        const Quat a = s.attitude(), b = s.attitude();
        const Vec3 v = s.vector(10);
        EXPECT_TRUE(is_near((a * b) * v, a * (b * v), 1e-13));
        EXPECT_NEAR(norm(a * v), norm(v), 1e-13);
        EXPECT_TRUE(is_near(conjugate(a) * (a * v), v, 1e-13));
    }
}

TEST(Quat, ExpRotationMatchesRodrigues) {
    Seeded s(2);
    for (const double angle : kAngles)
        for (int i = 0; i < 50; ++i) {
            const Vec3 e = s.axis(), v = s.vector(1);
            const Quat q = exp_rotation(angle * e);
            EXPECT_NEAR(norm(q), 1, 1e-15) << angle;
            const Vec3 turned =
                std::cos(angle) * v + std::sin(angle) * cross(e, v) + (1 - std::cos(angle)) * dot(e, v) * e;
            EXPECT_TRUE(is_near(q * v, turned, 2e-15)) << angle;
        }
}

TEST(Quat, AngleBetweenKeepsItsDigitsFromTinyToHalfATurn) {
    Seeded s(3);
    for (const double angle : kAngles)
        for (int i = 0; i < 50; ++i) {
            const Vec3 e = s.axis();
            const Quat turned = exp_rotation(angle * e);
            // relative to the reference attitude 1 the quaternion holds the angle to rounding, however small
            EXPECT_NEAR(angle_between(Quat{}, turned), angle, 1e-15 * angle) << angle;
            const Quat a = s.attitude();
            EXPECT_NEAR(angle_between(a, a * turned), angle, 4e-15) << angle;
            EXPECT_EQ(angle_between(a, -a), 0) << "the other sign is the same rotation";
        }
}

TEST(Quat, ColumnsGoThereAndBack) {
    Seeded s(4);
    for (const double angle : kAngles)
        for (int i = 0; i < 100; ++i) {
            const Quat q = exp_rotation(angle * s.axis());
            const auto [cx, cy, cz] = columns(q);
            EXPECT_TRUE(is_near(cross(cx, cy), cz, 1e-14));
            EXPECT_TRUE(is_near(quat_from_columns(cx, cy, cz), q, 1e-14)) << angle;
        }
    for (const Vec3 axis : {Vec3{1, 0, 0}, Vec3{0, 1, 0}, Vec3{0, 0, 1}}) {  // exactly half a turn: w is 0
        const Quat q{0, axis.x, axis.y, axis.z};
        const auto [cx, cy, cz] = columns(q);
        EXPECT_TRUE(is_near(quat_from_columns(cx, cy, cz), q, 0));
    }
}

TEST(Slerp, EndsMiddleAndRate) {
    Seeded s(5);
    for (const double angle : kAngles) {
        if (angle > kPi - 1e-9) continue;  // the shortest arc is not one any more
        for (int i = 0; i < 50; ++i) {
            const Quat a = s.attitude(), b = a * exp_rotation(angle * s.axis());
            EXPECT_TRUE(is_near(slerp(a, b, 0), a, 1e-15));
            EXPECT_TRUE(is_near(slerp(a, b, 1), b, 1e-15));
            EXPECT_TRUE(is_near(slerp(a, b, 0.3), slerp(b, a, 0.7), 1e-9)) << angle;
            EXPECT_TRUE(is_near(slerp(a, -b, 0.3), slerp(a, b, 0.3), 1e-15)) << "sign of an end";
            EXPECT_NEAR(angle_between(a, slerp(a, b, 0.25)), 0.25 * angle, 2e-15);
            EXPECT_NEAR(norm(slerp(a, b, 0.6)), 1, 1e-15);
        }
    }
}

TEST(PosePath, TurnsAtAConstantRate) {
    Seeded s(1);
    for (const double angle : {1e-9, 1e-4, 1.9e-3, 2.1e-3, 0.03, 0.4, 1.5, 3.0, kPi - 1e-6})
        for (int i = 0; i < 50; ++i) {
            const Quat start = s.attitude(), end = start * exp_rotation(angle * s.axis());
            for (const Quat& q : {end, -end}) {
                const PosePath path({start, {}}, {q, {}});
                EXPECT_NEAR(path.angle_rad(), angle, 2e-15);
                for (const double time : {0.0, 0.1, 0.5, 0.77, 1.0}) {
                    const Quat at = path.at(time).q;
                    EXPECT_NEAR(norm(at), 1, 1e-15);
                    EXPECT_NEAR(angle_between(start, at), time * angle, 2e-15) << angle << " at " << time;
                    EXPECT_NEAR(angle_between(at, q), (1 - time) * angle, 2e-15) << angle << " at " << time;
                }
            }
        }
}

TEST(PosePath, KeepsItsEndsBitForBit) {
    const Rigid3 start{normalized(Quat{0.3, -0.5, 0.7, 0.1}), {7e6, -3, 0.1}};
    const Rigid3 end{normalized(Quat{-0.3, 0.4, 0.7, 0.2}), {7e6 + 0.3, 5, 0.7}};
    EXPECT_EQ(PosePath(start, end).at(0), start);
    EXPECT_EQ(PosePath(start, end).at(1), end);
    EXPECT_TRUE(PosePath(start, end).moves());
    EXPECT_FALSE(PosePath(start).moves());
    EXPECT_EQ(PosePath(start).at(0.3), start);
    EXPECT_EQ(PosePath(start).angle_rad(), 0);
    EXPECT_LT(norm(PosePath(start, end).at(0.25).t - Vec3{7e6 + 0.075, -1, 0.25}), 1e-9);
}

TEST(Slerp, ExtrapolatesAtTheSameRate) {
    Seeded s(6);
    for (int i = 0; i < 100; ++i) {
        const Quat a = s.attitude();
        const Vec3 step = s.number(0, 0.5) * s.axis();
        EXPECT_TRUE(is_near(slerp(a, a * exp_rotation(step), 3), a * exp_rotation(3.0 * step), 1e-14));
        EXPECT_TRUE(is_near(slerp(a, a * exp_rotation(step), -1), a * exp_rotation(-step), 1e-14));
    }
}

TEST(Slerp, AgreesWithTheOracle) {
    NEED_ORACLE(oracle, "quaternion_interp");
    const auto quat = [](const nlohmann::json& q) { return Quat{q.at(0), q.at(1), q.at(2), q.at(3)}; };
    ASSERT_FALSE(oracle.at("cases").empty());
    for (const nlohmann::json& c : oracle.at("cases")) {
        // next to half a turn the axis itself is known to 1e-8 only
        const double tolerance = c.at("group") == "near180" ? 1e-8 : 1e-14;
        const Quat q = slerp(quat(c.at("in").at("q0_wxyz")), quat(c.at("in").at("q1_wxyz")), c.at("in").at("s"));
        EXPECT_TRUE(is_near(q, quat(c.at("out").at("q_wxyz")), tolerance)) << c.at("group") << " " << c.at("id");
        const double angle = angle_between(quat(c.at("in").at("q0_wxyz")), quat(c.at("in").at("q1_wxyz")));
        EXPECT_NEAR(angle, c.at("out").at("rotation_angle_rad"), tolerance) << c.at("group") << " " << c.at("id");
    }
}

TEST(Rigid3, InverseUndoesApply) {
    Seeded s(7);
    for (const double size : {1.0, 1e3, 6.778e6}) {
        for (int i = 0; i < 300; ++i) {
            const Rigid3 T = s.pose(size);
            const Vec3 p = s.vector(size);
            EXPECT_TRUE(is_near(inverse(T) * (T * p), p, 1e-14 * size));
            const Rigid3 identity = T * inverse(T);
            EXPECT_TRUE(is_near(identity.q, Quat{}, 1e-15));
            EXPECT_TRUE(is_near(identity.t, Vec3{}, 1e-14 * size));
        }
    }
}

TEST(Rigid3, ProductCancelsNeighbours) {
    Seeded s(8);
    for (int i = 0; i < 300; ++i) {
        const Rigid3 T_world_body = s.pose(100), T_body_camera = s.pose(1);
        const Vec3 p_camera = s.vector(10);
        EXPECT_TRUE(
            is_near((T_world_body * T_body_camera) * p_camera, T_world_body * (T_body_camera * p_camera), 1e-12));
    }
}

}  // namespace
}  // namespace narpa
