// A data packet of a VLP-16, in single or dual return mode, as a navigation program receives it.
#include "protocols/lidar/velodyne.h"

#include <array>
#include <cmath>
#include <vector>

#include "tests/fuzz/fuzz.h"

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    using namespace narpa;
    static const std::array units{vlp16().configure_default(),
                                  vlp16().configure({.rate_hz = 10, .returns = LidarReturns::dual})};
    const LidarModel& model = *units[size > 1204 && data[1204] == 0x39 ? 1 : 0];
    std::vector<LidarPoint> points(model.spec().points_per_packet);
    const std::size_t count = model.points({data, size}, points);
    (void)fuzz::count(count > 0);
    fuzz::require(count <= points.size(), "no more points than the packet holds");
    for (std::size_t i = 0; i < count; ++i) {
        const LidarPoint& p = points[i];
        fuzz::require(p.range_m > 0 && p.range_m <= model.spec().range_m_max, "a range is one that packets hold");
        fuzz::require(std::abs(norm(p.direction) - 1) < 1e-9, "a direction is unit");
        fuzz::require(p.beam >= 0 && p.beam < 16 && p.intensity >= 0 && p.intensity <= 255, "beam and intensity");
    }
    if (const auto t_ns = model.packet_time({data, size}, 1'700'000'000'000'000'000))
        fuzz::require(std::abs(*t_ns - 1'700'000'000'000'000'000) <= 3'600'000'000'000, "the time is near");
    return 0;
}
