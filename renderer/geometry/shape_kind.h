/// renderer/geometry/shape_kind.h - the kinds of exact shapes that scenes name, one row each.
///
/// A new kind is a Shape (shape.h) in files of its own, with its row, and a line in shape_kinds.cpp.
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <string_view>

#include "renderer/geometry/shape.h"
#include "renderer/keys/keys.h"

namespace narpa {

class TableReader;

struct ShapeKind {
    std::string_view name;      ///< key of a body in scene files: `sphere = {...}`
    std::string_view example;   ///< its value, for a body without a shape: "{radius_m = ...}"
    TableKeys keys{};           ///< of its table: numbers, or arrays of numbers of one length; all required
    std::string_view expected;  ///< what `values` have to be: "the radius of a sphere is ..."
    /// Null if the values are not such a shape's. Where the material has maps, the shape gets texture coordinates.
    std::shared_ptr<const Shape> (*make)(std::span<const double> values, int material,
                                         std::optional<MapLatitude> maps) = nullptr;
    /// Null: it is no ellipsoid.
    Vec3 (*semi_axes_m)(std::span<const double> values) = nullptr;
};

inline constexpr Range kShapeLength{.low = 0, .high = 1e15, .low_open = true};

/// All kinds, in the order of the documents.
[[nodiscard]] std::span<const ShapeKind* const> shape_kinds();
/// Keys of a body: one for each kind.
extern const TableKeys kShapeKeys;
/// The first kind that the body's table has, of material 0.
[[nodiscard]] std::optional<ExactShape> read_exact_shape(TableReader& body);

/// Of a body that is a sphere or an ellipsoid.
[[nodiscard]] std::optional<Vec3> semi_axes_m(const Body& body);

}  // namespace narpa
