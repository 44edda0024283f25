#include <array>

#include "renderer/geometry/ellipsoid.h"
#include "renderer/geometry/shape_kind.h"
#include "renderer/keys/toml_reader.h"

namespace narpa {
namespace {

constexpr std::array kShapeKinds{&kSphere, &kEllipsoid};

constexpr auto kShapeRows = [] {
    std::array<TableKey, kShapeKinds.size()> all{};
    for (std::size_t i = 0; i < all.size(); ++i) all[i] = {kShapeKinds[i]->name, rows::table(kShapeKinds[i]->keys)};
    return all;
}();

}  // namespace

constinit const TableKeys kShapeKeys{.rows = kShapeRows};

std::span<const ShapeKind* const> shape_kinds() {
    return kShapeKinds;
}

std::optional<ExactShape> read_exact_shape(TableReader& body) {
    std::optional<ExactShape> shape;
    for (const ShapeKind* kind : kShapeKinds) {
        auto table = body.table(kind->name);
        if (!table || shape) continue;
        shape = ExactShape{kind, table->values(kind->keys.rows, 1)};
        table->finish();
    }
    return shape;
}

std::optional<Vec3> semi_axes_m(const Body& body) {
    const auto* const exact = std::get_if<ExactShape>(&body.shape);
    if (!exact || !exact->kind->semi_axes_m) return std::nullopt;
    return exact->kind->semi_axes_m(exact->values);
}

}  // namespace narpa
