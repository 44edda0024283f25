#include <algorithm>
#include <array>
#include <cassert>

#include "renderer/projection/brown_conrady.h"
#include "renderer/projection/double_sphere.h"
#include "renderer/projection/kannala_brandt.h"
#include "renderer/projection/projection_kind.h"

namespace narpa {
namespace {

constexpr std::array<const ProjectionKind*, 4> kKinds{
    &kPinhole,
    &kBrownConrady,
    &kKannalaBrandt,
    &kDoubleSphere,
};

const ProjectionKind* found(std::string_view name, std::string_view ProjectionKind::*of) {
    const auto kind = std::ranges::find_if(kKinds, [&](const ProjectionKind* k) { return k->*of == name; });
    return name.empty() || kind == kKinds.end() ? nullptr : *kind;
}

}  // namespace

bool ProjectionKind::takes(std::size_t parameters) const {
    const bool is_array = keys.size() == 1 && keys[0].value.type == KeyValue::Type::numbers;
    return is_array ? keys[0].value.allows(parameters) : parameters == keys.size();
}

std::span<const ProjectionKind* const> projection_kinds() {
    return kKinds;
}
const ProjectionKind* projection_kind(std::string_view name) {
    return found(name, &ProjectionKind::name);
}
const ProjectionKind* opencv_kind(std::string_view name) {
    return found(name, &ProjectionKind::opencv);
}

std::shared_ptr<const CameraModel> make_projection(const ProjectionParameters& p) {
    assert(p.kind != nullptr);
    return p.kind->takes(p.values.size()) ? p.kind->make(p.pinhole, p.values) : nullptr;
}

ProjectionParameters opencv_parameters(const CameraModel& model) {
    ProjectionParameters p = model.parameters();
    if (p.kind == &kPinhole) return {&kBrownConrady, p.pinhole, std::vector<double>(5)};
    if (p.kind != nullptr && p.kind->opencv.empty()) p.kind = nullptr;
    return p;
}

}  // namespace narpa
