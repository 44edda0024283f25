/// renderer/trajectory/sampled_course.h - positions or attitudes that a file states at some times, at any
/// time between them.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/result.h"

namespace narpa {

/// A polynomial through the nearest samples: of this degree through the values (linear, lagrange), or through
/// values and derivatives, with half as many samples (hermite).
struct Interpolation {
    enum class Method : std::uint8_t { linear, lagrange, hermite };
    static constexpr std::array<std::pair<std::string_view, Method>, 3> kMethods{
        {{"LINEAR", Method::linear}, {"LAGRANGE", Method::lagrange}, {"HERMITE", Method::hermite}}};
    static constexpr int kDegreeMax = 31;

    Method method{};
    int degree = 1;

    [[nodiscard]] std::size_t samples() const {
        return static_cast<std::size_t>(method == Method::hermite ? (degree + 1) / 2 : degree + 1);
    }
    /// Why there is no such polynomial: completes "DEGREE, ..."; empty if there is.
    [[nodiscard]] std::string problem() const;
};

/// Three components of a position (m), or four of a quaternion (w, x, y, z), not normalised.
using CourseValue = std::array<double, 4>;

struct CourseSample {
    std::int64_t t_ns = 0;              ///< TAI since 2000
    CourseValue value{}, rate_per_s{};  ///< rate: for hermite
    int line = 0;                       ///< of the file
};

/// A part of a file that is interpolated by itself.
struct CourseSegment {
    Interpolation interpolation{};
    std::int64_t from_ns = 0, to_ns = 0;  ///< TAI since 2000, inclusive: where it may be used
    std::vector<CourseSample> samples{};  ///< times increase
    int line = 0;                         ///< of the file, where it begins

    /// At least one sample. Extrapolates at the ends.
    [[nodiscard]] std::pair<CourseValue, CourseValue> at(std::int64_t t_ns) const;
};

struct SampledCourse {
    std::string file;
    std::string centre{};   ///< of positions in an inertial frame, as the file names it
    bool in_world = false;  ///< in the scene's world axes; else ICRF
    std::vector<CourseSegment> segments{};

    [[nodiscard]] std::int64_t from_ns() const;
    [[nodiscard]] std::int64_t to_ns() const;
    /// Value and derivative by time (per s), of the last segment that may be used at this time; nullopt: none.
    [[nodiscard]] std::optional<std::pair<CourseValue, CourseValue>> at(std::int64_t t_ns) const;
};

/// Before a quaternion becomes the next sample: gives it the sign that is nearer to the last one's. The Error,
/// without a file: its norm is not 1 within 1e-3.
[[nodiscard]] Status accept_quaternion(const CourseSegment& segment, CourseSample& sample);
/// Closes a segment: an Error, without a file, if it has too few samples for its interpolation.
[[nodiscard]] Status check_samples(const CourseSegment& segment);

}  // namespace narpa
