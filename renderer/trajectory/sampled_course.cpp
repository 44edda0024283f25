#include "renderer/trajectory/sampled_course.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <span>

namespace narpa {
namespace {

using Method = Interpolation::Method;

/// Of samples, which are nearest to a time, seconds from `t_ns`; in Newton's form, each sample twice where its
/// derivative counts too.
class NewtonPolynomial {
public:
    NewtonPolynomial(std::span<const CourseSample> samples, bool with_rates, std::int64_t t_ns) {
        for (const CourseSample& s : samples)
            for (int twice = 0; twice < (with_rates ? 2 : 1); ++twice, ++count_) {
                at_s_[count_] = 1e-9 * static_cast<double>(s.t_ns - t_ns);
                terms_[count_] = s.value;
            }
        for (std::size_t order = 1; order < count_; ++order)
            for (std::size_t i = count_ - 1; i >= order; --i) {
                const double step_s = at_s_[i] - at_s_[i - order];
                const CourseSample& sample = samples[with_rates ? i / 2 : i];
                for (std::size_t k = 0; k < terms_[i].size(); ++k)
                    terms_[i][k] = step_s == 0 ? sample.rate_per_s[k] : (terms_[i][k] - terms_[i - 1][k]) / step_s;
            }
    }

    /// Value and derivative at the time itself.
    [[nodiscard]] std::pair<CourseValue, CourseValue> at_time() const {
        CourseValue value{}, rate{};
        for (std::size_t i = count_; i-- > 0;)
            for (std::size_t k = 0; k < value.size(); ++k) {
                rate[k] = value[k] - at_s_[i] * rate[k];
                value[k] = terms_[i][k] - at_s_[i] * value[k];
            }
        return {value, rate};
    }

private:
    std::size_t count_ = 0;
    std::array<double, Interpolation::kDegreeMax + 1> at_s_{};
    std::array<CourseValue, Interpolation::kDegreeMax + 1> terms_{};
};

}  // namespace

std::string Interpolation::problem() const {
    if (method == Method::linear && degree != 1) return "expected 1 for LINEAR";
    if (degree < 1 || degree > kDegreeMax) return fmt::format("expected 1 to {}", kDegreeMax);
    if (method == Method::hermite && degree % 2 == 0)
        return "expected an odd degree for HERMITE: each sample has a value and a derivative";
    return {};
}

std::pair<CourseValue, CourseValue> CourseSegment::at(std::int64_t t_ns) const {
    const std::size_t count = std::min(interpolation.samples(), samples.size());
    const auto after = std::ranges::upper_bound(samples, t_ns, {}, &CourseSample::t_ns);
    const auto index = static_cast<std::size_t>(after - samples.begin());
    const std::size_t first = std::min(index - std::min(index, (count + 1) / 2), samples.size() - count);
    return NewtonPolynomial(std::span(samples).subspan(first, count), interpolation.method == Method::hermite, t_ns)
        .at_time();
}

std::int64_t SampledCourse::from_ns() const {
    return std::ranges::min(segments, {}, &CourseSegment::from_ns).from_ns;
}
std::int64_t SampledCourse::to_ns() const {
    return std::ranges::max(segments, {}, &CourseSegment::to_ns).to_ns;
}

std::optional<std::pair<CourseValue, CourseValue>> SampledCourse::at(std::int64_t t_ns) const {
    for (std::size_t i = segments.size(); i-- > 0;)
        if (t_ns >= segments[i].from_ns && t_ns <= segments[i].to_ns) return segments[i].at(t_ns);
    return std::nullopt;
}

Status accept_quaternion(const CourseSegment& segment, CourseSample& sample) {
    const auto product = [](const CourseValue& a, const CourseValue& b) {
        return a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3];
    };
    const double norm = std::sqrt(product(sample.value, sample.value));
    if (!(std::abs(norm - 1) <= 1e-3))
        return Error{fmt::format("quaternion of norm {:.6g}, expected a unit quaternion", norm)};
    if (segment.samples.empty() || product(sample.value, segment.samples.back().value) >= 0) return Ok{};
    for (std::size_t k = 0; k < sample.value.size(); ++k) {
        sample.value[k] = -sample.value[k];
        sample.rate_per_s[k] = -sample.rate_per_s[k];
    }
    return Ok{};
}

Status check_samples(const CourseSegment& segment) {
    const std::size_t needed = segment.interpolation.samples();
    if (segment.samples.size() >= needed) return Ok{};
    const auto name = Interpolation::kMethods[static_cast<std::size_t>(segment.interpolation.method)].first;
    return Error{fmt::format("{} states, expected at least {} for {} of degree {}", segment.samples.size(), needed,
                             name, segment.interpolation.degree),
                 {},
                 segment.line};
}

}  // namespace narpa
