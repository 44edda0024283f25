#include "protocols/lidar/lidar_model.h"

#include <vector>

#include "protocols/lidar/vlp16.h"

namespace narpa {
namespace {

std::vector<const LidarModel*>& models() {
    static std::vector<const LidarModel*> all{&vlp16()};
    return all;
}

}  // namespace

std::span<const LidarModel* const> lidar_models() noexcept {
    return models();
}

const LidarModel* find_lidar_model(std::string_view name) noexcept {
    for (const LidarModel* model : models())
        if (model->spec().name == name) return model;
    return nullptr;
}

void add_lidar_model(const LidarModel& model) {
    models().push_back(&model);
}

}  // namespace narpa
