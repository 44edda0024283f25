/// renderer/projection/projection_kind.h - the kinds of camera projections: their names and parameters in files.
///
/// A new kind is a CalibratedModel (calibrated_model.h) in files of its own, and one row in projection_kinds.cpp.
#pragma once

#include <memory>
#include <span>
#include <string_view>
#include <vector>

#include "renderer/keys/keys.h"
#include "renderer/projection/pinhole.h"

namespace narpa {

/// `distortion_model` in the files of ROS, for at most so many parameters.
struct RosName {
    std::string_view name;
    std::size_t parameters_max = 0;
};

struct ProjectionKind {
    std::string_view name;             ///< of `projection = {kind = ...}` in scene files
    std::string_view opencv{};         ///< of `distortion = {model = ...}`; empty: no model of OpenCV
    std::span<const RosName> ros{};    ///< empty: ROS has no name for it
    std::span<const TableKey> keys{};  ///< of its parameters: an array of numbers, or a number each
    double fov_max_deg = 180;
    /// `parameters`: as many as the keys allow.
    std::shared_ptr<const CameraModel> (*make)(const Pinhole& pinhole,
                                               std::span<const double> parameters) = nullptr;

    [[nodiscard]] bool takes(std::size_t parameters) const;
};

/// All kinds, in the order of the documents.
[[nodiscard]] std::span<const ProjectionKind* const> projection_kinds();
/// The kind of this name, and the kind that OpenCV calls so; null if there is none.
[[nodiscard]] const ProjectionKind* projection_kind(std::string_view name);
[[nodiscard]] const ProjectionKind* opencv_kind(std::string_view name);

/// A projection as files state it.
struct ProjectionParameters {
    const ProjectionKind* kind = nullptr;  ///< null: of no kind that files name; then fx .. cy are NaN
    Pinhole pinhole{};                     ///< fx, fy, cx, cy
    std::vector<double> values{};          ///< the kind's parameters, in the order of its keys
};

/// Null if the kind does not take this number of parameters.
[[nodiscard]] std::shared_ptr<const CameraModel> make_projection(const ProjectionParameters& parameters);

/// What files of OpenCV and ROS state, where a pinhole has coefficients of 0. `kind` is null if they have no name
/// for the projection.
[[nodiscard]] ProjectionParameters opencv_parameters(const CameraModel& model);

}  // namespace narpa
