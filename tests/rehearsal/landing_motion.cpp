// The fall to the ground of a rotating planet, engine, and feet on the ground.
#include <cmath>
#include <fstream>

#include "base/time.h"
#include "rehearsal/navigation/estimation/relative_motion.h"
#include "tests/rehearsal/dynamics_support.h"
#include "tests/support/temporary_folder.h"

namespace narpa::rehearsal {
namespace {

/// Mars at 30 degrees north; the world's z is up, y north.
Orbit mars() {
    Orbit o;
    o.model = orbit_model("surface");
    o.radius_m = 3.39e6;
    o.mu_m3_s2 = 4.282837e13;
    o.up = {0, 0, 1};
    o.axis = {0, std::cos(30 * kDegree), std::sin(30 * kDegree)};
    o.rotation_rad_s = 7.0882e-5;
    o.j2 = 1.96045e-3;
    o.equatorial_radius_m = 3.39619e6;
    return o;
}

/// mu / r (1 - J2 (R / r)^2 P2(sin latitude))
double potential(const Orbit& o, const Vec3& p, const Vec3& axis) {
    const double r = norm(p), s = dot(p, axis) / r, k = o.equatorial_radius_m / r;
    return o.mu_m3_s2 / r * (1 - o.j2 * k * k * 0.5 * (3 * s * s - 1));
}

TEST(SurfaceGravity, IsThatOfAPointMassWithJ2AtPoleAndEquator) {
    const Orbit o = mars();
    const double g = o.mu_m3_s2 / (o.radius_m * o.radius_m), k = o.equatorial_radius_m / o.radius_m;
    expect_near(o.gravity_m_s2({0, 0, o.radius_m}, {0, 0, 1}), {0, 0, -g * (1 - 3 * o.j2 * k * k)}, 1e-12);
    expect_near(o.gravity_m_s2({o.radius_m, 0, 0}, {0, 0, 1}), {-g * (1 + 1.5 * o.j2 * k * k), 0, 0}, 1e-12);
}

TEST(SurfaceGravity, IsTheGradientOfThePotential) {
    const Orbit o = mars();
    const Vec3 axis = normalized(Vec3{0.1, -0.3, 0.9});
    for (const Vec3& p : {Vec3{3.4e6, 1e5, 2e5}, Vec3{-1e6, 2.5e6, -2.2e6}}) {
        Vec3 slope;
        for (int i = 0; i < 3; ++i) {
            Vec3 step;
            step[i] = 100;
            slope[i] = (potential(o, p + step, axis) - potential(o, p - step, axis)) / 200;
        }
        expect_near(o.gravity_m_s2(p, axis), slope, 1e-6);
    }
}

TEST(SurfaceMotion, AFallKeepsItsEnergyInTheAxesThatTurnWithThePlanet) {
    const Orbit o = mars();
    const Vec3 axis = normalized(o.axis), rate = o.rotation_rad_s * axis;
    const auto energy = [&](double t_s, const Translation& x) {
        const Vec3 ground = exp_rotation(t_s * rate) * (o.radius_m * o.up), from_centre = ground + x.position_m;
        const Vec3 velocity = x.velocity_m_s - cross(rate, x.position_m), carried = cross(rate, from_centre);
        return 0.5 * dot(velocity, velocity) - 0.5 * dot(carried, carried) - potential(o, from_centre, axis);
    };
    Translation x{{-5000, 3000, 60'000}, {150, -40, 30}};
    const double before = energy(0, x);
    for (int i = 0; i < 150; ++i) x = propagated(o, i, 1, {}, x);
    EXPECT_LT(norm(x.position_m - Vec3{-5000, 3000, 60'000}), 5e4);
    EXPECT_GT(norm(x.position_m - Vec3{-5000, 3000, 60'000}), 2e4);
    EXPECT_NEAR(energy(150, x), before, 1e-6);  // of 1.3e7 m^2 s^-2
}

TEST(SurfaceMotion, ADroppedBodyTakesTheTimeOfFreeFallAndDriftsEast) {
    const Orbit o = mars();
    const double height = 100, latitude = 30 * kDegree, w = o.rotation_rad_s;
    const Vec3 axis = normalized(o.axis), rate = w * axis;
    Translation x{{0, 0, height}, cross(rate, Vec3{0, 0, height})};
    const GroundField field = ground_field(o);
    const double g = -dot(o.q_world_frame(0) * field.gravity_m_s2, o.up), t_s = std::sqrt(2 * height / g);
    x = propagated(o, 0, t_s, {}, x);
    const Vec3 at = exp_rotation(-t_s * rate) * x.position_m;
    EXPECT_NEAR(at.z, 0, 0.01);  // gravity grows by 6e-5 over that height
    EXPECT_NEAR(at.x, w * g * std::pow(t_s, 3) * std::cos(latitude) / 3, 1e-4);  // Coriolis: 8.4 mm
    EXPECT_GT(at.x, 0.005);
}

TEST(GroundField, IsWhatTheFilterAndTheTruthFallIn) {
    const Orbit o = mars();
    MotionModel model;
    model.orbit_rate_rad_s = o.rate_rad_s();
    model.ground = ground_field(o);
    RelativeMotion motion;
    motion.position_m = {400, -300, 1500};
    motion.velocity_m_s = {20, 10, -40};
    RelativeState state = in_frame(motion, o, 0);
    Matrix12 covariance = Matrix12::Identity();
    Translation truth{motion.position_m, motion.velocity_m_s};
    for (int i = 0; i < 100; ++i) {
        propagate(model, 0.3, {}, state, covariance);
        truth = propagated(o, 0.3 * i, 0.3, {}, truth);
    }
    const RelativeMotion then = in_world(state, o, 30, {}, {});
    expect_near(then.position_m, truth.position_m, 0.005);  // second order in the height over the radius
    expect_near(then.velocity_m_s, truth.velocity_m_s, 5e-4);
}

Scenario with_engine() {
    Scenario s = quiet(orbit_model("surface"));
    s.orbit = mars();
    s.navigation.period_s = 0.5;
    s.engine = Engine{.group = 4, .least_n = 1000, .most_n = 5000, .gain_sigma = 0};
    return s;
}

TEST(EngineModel, BurnsForThePeriodWithinItsLimitsAndIsOffAtZero) {
    const Scenario s = with_engine();
    ThrusterModel model(s, 1);
    for (const auto& [impulse, force] : {std::pair{1500.0, 3000.0}, {1.0, 1000.0}, {9000.0, 5000.0}, {0.0, 0.0}}) {
        ActuatorCommand command;
        command.impulse_n_s = {0, 0, impulse};
        model.fire(command, 0);
        expect_near(model.loads(0).force_n, {0, 0, force}, 1e-9);
        expect_near(model.loads(499'999'999).force_n, {0, 0, force}, 1e-9);
        EXPECT_EQ(model.loads(500'000'000).force_n, Vec3{});
    }
}

TEST(EngineModel, AStuckThrottleGivesTheLeastForce) {
    Scenario s = with_engine();
    s.faults.push_back({fault_kind("throttle_stuck"), 0.2, 0.4, "", {}});
    ThrusterModel model(s, 1);
    ActuatorCommand command;
    command.impulse_n_s = {0, 0, 2000};
    model.fire(command, 0);
    expect_near(model.loads(0).force_n, {0, 0, 4000}, 1e-9);
    EXPECT_EQ(model.next_change_ns(0), 200'000'000);
    expect_near(model.loads(200'000'000).force_n, {0, 0, 1000}, 1e-9);
    expect_near(model.loads(400'000'000).force_n, {0, 0, 4000}, 1e-9);
}

TEST(EngineModel, BurnsPropellant) {
    Scenario s = with_engine();
    s.engine->specific_impulse_s = 200;
    Simulation simulation(s, 1);
    ActuatorCommand command;
    command.impulse_n_s = {0, 0, 2000};
    ASSERT_TRUE(simulation.apply(command));
    simulation.advance_to(ns(0.5));
    EXPECT_NEAR(simulation.mass_kg(), s.chaser.mass_kg - 2000 / (200 * 9.80665), 1e-9);
}

/// Ground that rises by `slope` to the north, with a wall 0.5 m high along x = 1.2 m, and a lander of 500 kg whose
/// feet are 1 m below it.
class OnGround : public testing::Test {
protected:
    Scenario scenario(double slope = 0, bool wall = false) {
        std::ofstream obj(folder_ / "ground.obj");
        for (const int x : {-50, 50})
            for (const int y : {-50, 50}) obj << "v " << x << " " << y << " " << slope * y << "\n";
        obj << "f 1 3 4 2\n";
        if (wall) obj << "v 1.1 -50 0.5\nv 1.1 50 0.5\nv 1.3 50 0.5\nv 1.3 -50 0.5\nf 5 8 7 6\n";
        obj.close();
        std::ofstream(folder_ / "scene.toml") << R"([scene]
name = "ground"
[sun]
direction = [0, 0, 1]
[[body]]
name = "ground"
mesh = "ground.obj"
can_id = 0x110
[[body]]
name = "lander"
sphere = { radius_m = 0.5 }
can_id = 0x100
position_m = [0, 0, 10]
[[camera]]
name = "nav"
mount = "lander"
resolution = [32, 32]
fov_horizontal_deg = 60.0
)";
        Scenario s = with_engine();
        s.scene = folder_ / "scene.toml";
        s.target = {.body = "ground", .can_id = 0x110, .T_body_port = {{0, std::sqrt(0.5), 0, std::sqrt(0.5)}, {}}};
        s.target_motion.with_lvlh = true;
        s.chaser.centre_of_mass_m = {};
        s.chaser.T_body_port = {{std::sqrt(0.5), 0, std::sqrt(0.5), 0}, {0, 0, -1}};
        s.chaser.mass_kg = 500;
        s.chaser.inertia_kg_m2 = 200 * Eigen::Matrix3d::Identity();
        s.gear = LandingGear{};
        for (const double y : {-1.2, 1.2})
            for (const double z : {-1.2, 1.2}) s.gear->feet_m.push_back({0, y, z});
        s.start.position_m = {2, 0, 0};
        s.duration_s = 60;
        return s;
    }
    Simulation simulation(const Scenario& s) {
        auto terrain = Terrain::create(s);
        EXPECT_TRUE(terrain) << terrain.error().text();
        terrain_ = *std::move(terrain);
        return {s, 1, terrain_};
    }
    /// Advances until the phase changes, or nothing more happens.
    static DynamicsPhase next_phase(Simulation& s) {
        const DynamicsPhase before = s.phase();
        while (s.phase() == before && s.ending() == Ending::not_yet) s.advance_to(s.t_ns() + ns(0.25));
        return s.phase();
    }

    test::TemporaryFolder folder_;
    std::shared_ptr<const Terrain> terrain_;
};

TEST_F(OnGround, ADropTouchesDownAfterTheTimeOfFreeFallAndComesToRestOnItsFeet) {
    const Scenario s = scenario();
    Simulation dropped = simulation(s);
    EXPECT_NEAR(dropped.clearance_m().value(), 2, 1e-9);
    ASSERT_EQ(next_phase(dropped), DynamicsPhase::touched_down);
    const double g = norm(s.orbit.relative_free_fall_m_s2(0, {}));
    EXPECT_NEAR(to_seconds(dropped.t_ns()), std::sqrt(4 / g), 0.002);  // the steps before are of 1 ms
    EXPECT_NEAR(dropped.contact()->port.closing_m_s(), std::sqrt(4 * g), 0.01);
    ASSERT_EQ(next_phase(dropped), DynamicsPhase::landed);
    EXPECT_NEAR(dropped.clearance_m().value(), -500 * g / (4 * s.gear->stiffness_n_m), 2e-4);
    EXPECT_NEAR(dropped.port().lateral_m(), 0, 0.01);
    while (dropped.ending() == Ending::not_yet) dropped.advance_to(dropped.t_ns() + ns(0.25));
    EXPECT_EQ(dropped.ending(), Ending::landed);
}

TEST_F(OnGround, AtRestTheFeetCarryTheWeightWithoutATorque) {
    const Scenario s = scenario(0.1);
    Simulation dropped = simulation(s);
    while (dropped.phase() != DynamicsPhase::landed && dropped.ending() == Ending::not_yet) next_phase(dropped);
    ASSERT_EQ(dropped.phase(), DynamicsPhase::landed);
    GroundContact feet(*s.gear, terrain_);
    const PortState p = dropped.port();
    const GroundForces f = feet.press(p);  // without the friction that has built up
    const double weight = 500 * norm(s.orbit.relative_free_fall_m_s2(0, {}));
    EXPECT_NEAR(f.force_n.x, weight, 0.02 * weight);
    EXPECT_NEAR(p.pitch_yaw_rad(), std::atan(0.1), 0.02);  // it leans with the ground
}

TEST_F(OnGround, SlidesWhereFrictionIsLess) {
    Scenario steep = scenario(0.3);
    steep.gear->friction = 0.1;
    steep.start.position_m = {0.5, 0, 0};
    steep.duration_s = 6;
    Simulation dropped = simulation(steep);
    EXPECT_EQ(next_phase(dropped), DynamicsPhase::touched_down);
    next_phase(dropped);
    EXPECT_NE(dropped.phase(), DynamicsPhase::landed);
    EXPECT_GT(dropped.port().lateral_m(), 2);
}

TEST_F(OnGround, TooHardALandingBreaksAFoot) {
    Scenario hard = scenario();
    hard.start.velocity_m_s = {-25, 0, 0};
    Simulation dropped = simulation(hard);
    ASSERT_EQ(next_phase(dropped), DynamicsPhase::touched_down);
    ASSERT_EQ(next_phase(dropped), DynamicsPhase::crashed);
    while (dropped.ending() == Ending::not_yet) dropped.advance_to(dropped.t_ns() + ns(0.25));
    EXPECT_EQ(dropped.ending(), Ending::crashed);
}

TEST_F(OnGround, TooFastAcrossTheGroundTipsOver) {
    Scenario fast = scenario();
    fast.gear->friction = 2;
    fast.gear->stroke_m = 5;
    fast.start.velocity_m_s = {0, 9, 0};
    Simulation dropped = simulation(fast);
    ASSERT_EQ(next_phase(dropped), DynamicsPhase::touched_down);
    EXPECT_EQ(next_phase(dropped), DynamicsPhase::crashed);
}

TEST_F(OnGround, FootingIsTheSlopeAndWhatStandsOutOfIt) {
    const std::vector<Vec3> feet{{0, -1, -1}, {0, -1, 1}, {0, 1, -1}, {0, 1, 1}};
    (void)simulation(scenario(0.2));
    const auto sloped = footing(*terrain_, feet);
    ASSERT_TRUE(sloped);
    EXPECT_NEAR(sloped->slope_rad, std::atan(0.2), 1e-6);
    EXPECT_NEAR(sloped->step_m, 0, 1e-6);
    (void)simulation(scenario(0, true));
    const auto stepped = footing(*terrain_, feet);
    ASSERT_TRUE(stepped);
    EXPECT_NEAR(stepped->slope_rad, 0, 1e-6);
    EXPECT_NEAR(stepped->step_m, 0.5, 1e-6);
    EXPECT_FALSE(footing(*terrain_, std::vector<Vec3>{{0, 0, 0}, {0, 1, 0}, {0, 0, 200}}));
}

}  // namespace
}  // namespace narpa::rehearsal
