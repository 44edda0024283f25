#include "protocols/lidar/lidar_model.h"

#include <algorithm>
#include <cmath>
#include <iterator>

#include "protocols/lidar/livox.h"
#include "protocols/lidar/ouster.h"
#include "protocols/lidar/velodyne.h"

namespace narpa {
namespace {

std::vector<const LidarMake*>& makes() {
    static std::vector<const LidarMake*> all = [] {
        std::vector<const LidarMake*> built_in{&vlp16(), &hdl32e(), &mid360()};
        std::ranges::copy(ouster_makes(), std::back_inserter(built_in));
        return built_in;
    }();
    return all;
}

}  // namespace

std::span<const LidarMake* const> lidar_makes() noexcept {
    return makes();
}

const LidarMake* find_lidar_make(std::string_view name) noexcept {
    for (const LidarMake* make : makes())
        if (make->name == name) return make;
    return nullptr;
}

void add_lidar_make(const LidarMake& make) {
    makes().push_back(&make);
}

bool LidarField::contains(const Vec3& d) const noexcept {
    switch (kind) {
        case Kind::beam: return false;
        case Kind::plane: return d.y > 0 && std::abs(d.x) <= d.y * horizontal && std::abs(d.z) <= d.y * vertical;
        case Kind::angles:
            return std::abs(std::atan2(d.x, d.y)) <= horizontal &&
                   std::abs(std::atan2(d.z, std::hypot(d.x, d.y))) <= vertical;
    }
    return false;
}

std::string LidarModel::mismatch(std::span<const std::uint8_t> bytes) const {
    return packet_time(bytes, 0) ? "" : "damaged, or of another instrument or mode";
}

std::int64_t LidarModel::sweep(std::int64_t packet) const noexcept {
    return std::llround(std::floor(static_cast<double>(packet_start_ns(packet)) * 1e-9 * spec_.rate_hz));
}

}  // namespace narpa
