#include "bench/lidar_cost.h"

#include <fmt/format.h>

#include <array>
#include <cmath>
#include <limits>

#include "base/counter_random.h"
#include "bench/embree/raw_embree_scene.h"
#include "bench/statistics.h"
#include "emulator/lidar/lidar_unit.h"
#include "renderer/lidar/beam_cone.h"

namespace narpa {
namespace {

/// The LiDAR with this many sub-rays.
Lidar with_sub_rays(Lidar lidar, int sub_rays, double divergence_rad) {
    lidar.receiver.beam_divergence_rad = divergence_rad;
    lidar.receiver.sub_rays = sub_rays;
    return lidar;
}

/// The LiDAR without random effects other than the sub-rays.
Lidar without_noise(Lidar lidar) {
    LidarReceiverModel& r = lidar.receiver;
    r.detection_snr = r.range_noise_m = r.range_noise_at_limit_m = r.velocity_noise_m_s = 0;
    return lidar;
}

/// The packets of one turn.
struct Turn {
    std::int64_t first = 0, end = 0;
};

Turn turn_of(const LidarUnit& unit, std::int64_t from_ns) {
    const auto turn_ns = static_cast<std::int64_t>(1e9 / unit.spec().rate_hz);
    return {unit.first_packet_from(from_ns), unit.first_packet_from(from_ns + turn_ns)};
}

double thread_s() {
    return cpu_s(CLOCK_THREAD_CPUTIME_ID);
}

double fire_turn(LidarUnit& unit, const Turn& turn) {
    const double start_s = thread_s();
    for (std::int64_t p = turn.first; p < turn.end; ++p) unit.fire(p);
    return thread_s() - start_s;
}

/// The strongest echo of each shot of the turn.
std::vector<double> ranges_of(LidarUnit& unit, const Turn& turn) {
    std::vector<double> out;
    for (std::int64_t p = turn.first; p < turn.end; ++p) {
        unit.fire(p);
        for (const LidarEchoes& e : unit.echoes()) out.push_back(e.strongest.range_m);
    }
    return out;
}

RangeError error_of(const std::vector<double>& ranges, const std::vector<double>& reference,
                    double pulse_length_m) {
    RangeError e;
    Mean all, same;
    std::vector<double> sizes;
    for (std::size_t i = 0; i < ranges.size(); ++i) {
        const bool here = ranges[i] > 0, there = reference[i] > 0;
        e.lost += there && !here ? 1 : 0;
        e.extra += here && !there ? 1 : 0;
        if (!here || !there) continue;
        const double error_m = ranges[i] - reference[i];
        all.add(error_m);
        sizes.push_back(std::abs(error_m));
        if (std::abs(error_m) > pulse_length_m)
            ++e.other;
        else
            same.add(error_m);
    }
    e.shots = sizes.size();
    e.rms_m = all.rms();
    e.same_surface_rms_m = same.rms();
    e.p50_m = quantile(sizes, 0.5);
    e.p99_m = quantile(sizes, 0.99);
    return e;
}

/// The rays of a turn, sixteen together, every body where it is in the middle of the packet.
class Rays {
public:
    Rays(const World& world, const Lidar& lidar, int sub_rays)
        : world_(world),
          lidar_(lidar),
          cone_(lidar.receiver.beam_divergence_rad, sub_rays),
          random_(world.scene().render.seed),
          shots_(lidar.model->spec().shots_per_packet) {}

    void of_packet(std::int64_t packet, BodyPoses& at, std::vector<RayBatch>& out) {
        const LidarModel& model = *lidar_.model;
        world_.place(model.packet_start_ns(packet) + model.spec().packet_period_ns / 2, lidar_.mount, at);
        const Rigid3 T_world_lidar = world_.sensor_pose(lidar_.mount, lidar_.T_mount_lidar, at);
        model.shots(packet, shots_);
        out.clear();
        for (std::size_t first = 0; first < shots_.size(); first += kLanes) {
            RayBatch beams;
            for (std::size_t i = first; i < std::min(first + kLanes, shots_.size()); ++i)
                beams.put(beams.n++, {T_world_lidar * shots_[i].origin_m, T_world_lidar.q * shots_[i].direction});
            const RandomLanes words =
                philox(random_, static_cast<std::uint32_t>(first), static_cast<std::uint32_t>(packet), 0);
            for (std::size_t i = 0; i < beams.n; ++i) put_sub_rays(beams[i], words.w0[i], out);
        }
    }

private:
    void put_sub_rays(const Ray& beam, std::uint32_t turn, std::vector<RayBatch>& out) const {
        const BeamCone::Across across = BeamCone::across(beam.direction, turn);
        for (std::size_t s = 0; s < cone_.size(); ++s) {
            if (out.empty() || out.back().n == kLanes) out.emplace_back();
            RayBatch& rays = out.back();
            rays.put(rays.n++, {beam.origin, cone_.direction(beam.direction, across, s), beam.time});
        }
    }

    const World& world_;
    const Lidar& lidar_;
    BeamCone cone_;
    PhiloxSchedule random_;
    std::vector<LidarShot> shots_;
};

/// Rounding to single precision and reading back the ranges are part of the cost.
void trace_plainly(RTCScene scene, const RayBatch& rays, Lanes<double>& range_m) {
    alignas(64) RTCRayHit16 q;
    alignas(64) std::array<int, kLanes> valid;
    for (std::size_t i = 0; i < kLanes; ++i) {
        valid[i] = i < rays.n ? -1 : 0;
        q.ray.org_x[i] = static_cast<float>(rays.origin.x[i]);
        q.ray.org_y[i] = static_cast<float>(rays.origin.y[i]);
        q.ray.org_z[i] = static_cast<float>(rays.origin.z[i]);
        q.ray.dir_x[i] = static_cast<float>(rays.direction.x[i]);
        q.ray.dir_y[i] = static_cast<float>(rays.direction.y[i]);
        q.ray.dir_z[i] = static_cast<float>(rays.direction.z[i]);
        q.ray.tnear[i] = 0, q.ray.tfar[i] = std::numeric_limits<float>::infinity();
        q.ray.time[i] = 0, q.ray.mask[i] = ~0u, q.ray.id[i] = 0, q.ray.flags[i] = 0;
        q.hit.geomID[i] = RTC_INVALID_GEOMETRY_ID, q.hit.instID[0][i] = RTC_INVALID_GEOMETRY_ID;
    }
    embree::intersect(scene, valid.data(), q, embree::Run::together);
    for (std::size_t i = 0; i < rays.n; ++i) range_m[i] = static_cast<double>(q.ray.tfar[i]);
}

/// CPU times of the bounds, one turn each.
struct Bounds {
    double tracer_s = 0, embree_s = 0;
};

Bounds trace_turn(const World& world, const RTCScene plain, Rays& rays, const Turn& turn) {
    Bounds b;
    BodyPoses at(world.scene().bodies.size());
    std::vector<RayBatch> batches;
    HitBatch hits;
    Lanes<double> range_m{};
    double sum_m = 0;  // so that nothing is optimised away
    for (std::int64_t p = turn.first; p < turn.end; ++p) {
        rays.of_packet(p, at, batches);
        double start_s = thread_s();
        for (const RayBatch& batch : batches) {
            world.tracer().intersect(at, batch, world.tracer().all_bodies(), hits);
            sum_m += hits.met != 0 ? 1 : 0;
        }
        b.tracer_s += thread_s() - start_s;
        if (plain == nullptr) continue;
        start_s = thread_s();
        for (const RayBatch& batch : batches) {
            trace_plainly(plain, batch, range_m);
            sum_m += range_m[0];
        }
        b.embree_s += thread_s() - start_s;
    }
    volatile double sink = sum_m;
    static_cast<void>(sink);
    return b;
}

}  // namespace

Result<LidarCost> measure_lidar_cost(Scene scene, const LidarCostSettings& s,
                                     const std::function<Status(World&)>& load,
                                     const std::function<void(const std::string&)>& progress) {
    // LiDARs of the scene: for each row as it is and without noise, and the reference.
    const Lidar lidar = scene.lidars[s.lidar];
    scene.lidars.clear();
    for (const int n : s.sub_rays) {
        scene.lidars.push_back(with_sub_rays(lidar, n, s.beam_divergence_rad));
        scene.lidars.push_back(without_noise(scene.lidars.back()));
    }
    scene.lidars.push_back(without_noise(with_sub_rays(lidar, s.reference_sub_rays, s.beam_divergence_rad)));
    auto made = World::create(std::move(scene));
    if (!made) return made.error();
    World& world = **made;
    if (auto loaded = load(world); !loaded) return loaded.error();

    std::vector<LidarUnit> units;
    units.reserve(world.scene().lidars.size());
    for (std::size_t i = 0; i < world.scene().lidars.size(); ++i) units.emplace_back(world, i);
    const Turn turn = turn_of(units.front(), s.from_ns);
    BodyPoses at(world.scene().bodies.size());
    world.place((units.front().packet_start_ns(turn.first) + units.front().packet_start_ns(turn.end)) / 2, -1, at);
    const auto plain = RawScene::build(world.scene(), at);

    LidarCost cost;
    const LidarSpec& spec = units.front().spec();
    cost.make = spec.name;
    cost.rate_hz = spec.rate_hz;
    cost.beam_divergence_rad = s.beam_divergence_rad;
    cost.pulse_length_m = lidar.receiver.pulse_length_m;
    cost.packets = static_cast<std::size_t>(turn.end - turn.first);
    cost.shots = cost.packets * spec.shots_per_packet;
    cost.covers_s = 1e-9 * static_cast<double>(static_cast<std::int64_t>(cost.packets) * spec.packet_period_ns);
    cost.reference_sub_rays = s.reference_sub_rays;

    progress(fmt::format("reference, {} sub-rays", s.reference_sub_rays));
    const double start_s = thread_s();
    const std::vector<double> reference = ranges_of(units.back(), turn);
    cost.reference_s = thread_s() - start_s;
    std::vector<std::vector<double>> fire_s(s.sub_rays.size()), tracer_s = fire_s, embree_s = fire_s;
    for (int n = 0; n < s.turns; ++n)
        for (std::size_t i = 0; i < s.sub_rays.size(); ++i) {
            progress(fmt::format("turn {} of {}, {} sub-rays", n + 1, s.turns, s.sub_rays[i]));
            fire_s[i].push_back(fire_turn(units[2 * i], turn));
            Rays rays(world, world.scene().lidars[2 * i], s.sub_rays[i]);
            const Bounds b = trace_turn(world, plain ? plain->scene.get() : nullptr, rays, turn);
            tracer_s[i].push_back(b.tracer_s);
            embree_s[i].push_back(b.embree_s);
        }
    for (std::size_t i = 0; i < s.sub_rays.size(); ++i) {
        LidarCostRow& row = cost.rows.emplace_back();
        row.sub_rays = s.sub_rays[i];
        row.fire_s = median(fire_s[i]);
        row.tracer_s = median(tracer_s[i]);
        if (plain) row.embree_s = median(embree_s[i]);
        row.error = error_of(ranges_of(units[2 * i + 1], turn), reference, cost.pulse_length_m);
    }
    for (std::int64_t p = turn.first; p < turn.end; ++p) {
        units.front().fire(p);
        cost.returns += units.front().returns();
    }
    return cost;
}

std::vector<std::string> lidar_cost_faults(const LidarCost& cost) {
    std::vector<std::string> faults;
    if (cost.make != "VLP-16" || cost.rate_hz > 10) return faults;
    for (const LidarCostRow& row : cost.rows)
        for (const auto [sub_rays, load_max] : kLidarLoadMost)
            if (row.sub_rays == sub_rays && cost.load(row) > load_max)
                faults.push_back(fmt::format("{} sub-ray{}: {:.1f} % of a core, expected at most {:.0f} %",
                                             sub_rays, sub_rays == 1 ? "" : "s", 100 * cost.load(row),
                                             100 * load_max));
    return faults;
}

}  // namespace narpa
