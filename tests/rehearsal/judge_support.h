// tests/rehearsal/judge_support.h - rehearsals as a list of messages, to be judged.
#pragma once

#include <string>
#include <vector>

#include "drivers/can/can_bus.h"
#include "protocols/can/messages.h"
#include "rehearsal/judge/judge.h"

namespace narpa::rehearsal {

/// Two bodies whose ports stand off their origins, in world axes that are the target's port axes.
inline Scenario small_scenario() {
    Scenario s;
    s.name = "small";
    s.duration_s = 100;
    s.orbit.model = orbit_model("free");
    s.target = {"station", 0x110, {}, {{1, 0, 0, 0}, {2, 0.5, 0}}, 1000, Eigen::Matrix3d::Identity()};
    s.chaser = {"chaser", 0x100, {}, {{1, 0, 0, 0}, {1.5, 0, 0.25}}, 100, Eigen::Matrix3d::Identity()};
    s.legs.resize(2);
    s.legs[0].name = "far";
    s.legs[1].name = "last";
    s.legs[1].contact = true;
    return s;
}

/// Where the chaser's body is so that its port is at `position_m` in the target's port axes (target at rest in the
/// world's origin), turned by `rotation_rad` off the docked attitude (chaser's port axes), moving so.
inline Motion chaser_at(const Scenario& s, const Vec3& position_m, const Vec3& velocity_m_s = {},
                        const Vec3& rotation_rad = {}, const Vec3& rate_rad_s = {}) {
    const Quat q_port = T_port_docked().q * exp_rotation(rotation_rad);
    const Rigid3 T_world_port = s.target.T_body_port * Rigid3{q_port, position_m};
    const Rigid3 T_world_chaser = T_world_port * inverse(s.chaser.T_body_port);
    const Vec3 arm = T_world_chaser.q * s.chaser.T_body_port.t;
    const Vec3 rate_world = T_world_chaser.q * rate_rad_s;
    return {T_world_chaser, s.target.T_body_port.q * velocity_m_s - cross(rate_world, arm), rate_rad_s};
}

/// The frames of a run, in the order of the bus.
class Messages {
public:
    explicit Messages(const Scenario& scenario, std::int64_t t_start_ns = 7'000'000'000)
        : scenario_(scenario), t_start_ns_(t_start_ns) {}

    std::vector<CanFrame> frames;

    [[nodiscard]] std::int64_t ns(double t_s) const { return t_start_ns_ + std::llround(t_s * 1e9); }

    void report(double t_s, DynamicsPhase phase = DynamicsPhase::flying) {
        put(encode_classic(DynamicsReport{counter_++, ns(t_s), t_start_ns_, phase}));
    }
    void poses(double t_s, const Motion& chaser, const Motion& target = {}) {
        pose(scenario_.target.can_id, t_s, target);
        pose(scenario_.chaser.can_id, t_s, chaser);
    }
    void command(double t_s, GuidancePhase phase = GuidancePhase::moving, std::uint8_t leg = 0,
                 AbortReason abort = AbortReason::none) {
        put(encode_classic(ActuatorCommand{counter_++, ns(t_s), {}, {}, phase, leg, abort}));
    }
    void heartbeat(double t_s, RunState state = RunState::lockstep) {
        frames.push_back(encode(Heartbeat{ns(t_s), state, false, false, false, false, counter_++}));
    }
    /// Off the truth by errors in the chaser's body axes.
    void estimate(double t_s, const Motion& chaser, const Vec3& error_m = {}, const Vec3& error_rad = {},
                  double sigma_m = 0.1, double sigma_rad = 0.01, const Motion& target = {},
                  std::uint8_t taken = 1) {
        NavigationEstimate e;
        e.cycle = cycle_++;
        e.t_ns = ns(t_s);
        e.T_chaser_target = inverse(chaser.T_world_body) * target.T_world_body;
        e.T_chaser_target.t += error_m;
        e.T_chaser_target.q = exp_rotation(error_rad) * e.T_chaser_target.q;
        e.sigma_position_m = {sigma_m, sigma_m, sigma_m};
        e.sigma_rotation_rad = {sigma_rad, sigma_rad, sigma_rad};
        e.frames = taken;
        put(encode_classic(e));
    }
    void ledger(std::uint32_t frame, double t_pose_s, double t_hand_over_s, bool met = true) {
        FrameLedger l;
        l.frame = frame;
        l.t_pose_ns = ns(t_pose_s);
        l.t_exposure_mid_ns = l.t_exposure_start_ns = l.t_exposure_end_ns = l.t_render_start_ns = ns(t_pose_s);
        l.t_render_end_ns = l.t_hand_over_ns = ns(t_hand_over_s);
        l.t_deadline_ns = ns(t_hand_over_s) + (met ? 1000 : -1000);
        l.deadline_met = met;
        put(encode_classic(l));
    }
    /// One control period of lockstep with a good estimate.
    void period(double t_s, const Motion& chaser, std::uint8_t leg = 0,
                GuidancePhase phase = GuidancePhase::moving) {
        report(t_s);
        poses(t_s, chaser);
        heartbeat(t_s);
        estimate(t_s, chaser);
        command(t_s, phase, leg);
    }

private:
    void put(const FrameSet& set) { frames.insert(frames.end(), set.begin(), set.end()); }
    void pose(std::uint32_t id, double t_s, const Motion& motion) {
        FrameSet set;
        if (encode_classic(PoseCommand{counter_++, ns(t_s), motion}, id, set)) put(set);
    }

    Scenario scenario_;
    std::int64_t t_start_ns_;
    std::uint8_t counter_ = 0;
    std::uint32_t cycle_ = 0;
};

/// From 10 m straight to the port within 10 periods, then contact as given.
inline Messages docking(const Scenario& s, const Motion& at_contact,
                        DynamicsPhase outcome = DynamicsPhase::captured, double off_axis_m = 0) {
    Messages m(s);
    for (int k = 0; k < 10; ++k)
        m.period(k, chaser_at(s, {10.0 - k, k == 5 ? off_axis_m : 0, 0}, {-1, 0, 0}), k < 5 ? 0 : 1);
    m.report(10, outcome);
    m.poses(10, at_contact);
    m.heartbeat(10);
    m.command(10, GuidancePhase::docked, 1);
    m.report(11, DynamicsPhase::finished);
    m.poses(11, at_contact);
    m.heartbeat(11);
    return m;
}

inline Verdict judge(const Scenario& s, const Messages& m, Judge::Failure reported = {}) {
    Judge judge(s, std::move(reported));
    for (const CanFrame& f : m.frames) judge.accept(f, m.ns(0));
    return judge.finish();
}

inline const GateResult& gate(const Verdict& v, const std::string& name) {
    for (const GateResult& g : v.gates)
        if (g.name == name) return g;
    static const GateResult none;
    return none;
}

}  // namespace narpa::rehearsal
