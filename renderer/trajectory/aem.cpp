// Attitude ephemeris messages with quaternions, CCSDS 504.0-B, versions 1 and 2.
//
// The quaternion (Q1, Q2, Q3, QC) = (e sin(phi / 2), cos(phi / 2)) is of the rotation by phi about e that turns the
// axes of frame A into those of frame B. As a Hamilton quaternion it therefore takes B's coordinates to A's.
#include <fmt/format.h>

#include "renderer/trajectory/ccsds_message.h"

namespace narpa {
namespace {

constexpr std::array<std::string_view, 2> kAemVersions{"1.0", "2.0"};
constexpr std::array<std::string_view, 18> kAemMetadata{
    "OBJECT_NAME",          "OBJECT_ID",     "CENTER_NAME",     "REF_FRAME_A", "REF_FRAME_B",
    "ATTITUDE_DIR",         "TIME_SYSTEM",   "START_TIME",      "STOP_TIME",   "USEABLE_START_TIME",
    "USEABLE_STOP_TIME",    "ATTITUDE_TYPE", "QUATERNION_TYPE", "RATE_FRAME",  "INTERPOLATION_METHOD",
    "INTERPOLATION_DEGREE", "ANGVEL_FRAME",  "EULER_ROT_SEQ"};
constexpr CcsdsKind kAem{.name = "AEM",
                         .what = "an attitude ephemeris message (CCSDS AEM)",
                         .versions = kAemVersions,
                         .metadata = kAemMetadata,
                         .method_key = "INTERPOLATION_METHOD",
                         .data_start = "DATA_START",
                         .data_stop = "DATA_STOP"};

/// Numbers behind the time, by ATTITUDE_TYPE.
constexpr std::size_t kPlain = 4, kWithRate = 7, kWithDerivative = 8;
constexpr std::array<std::pair<std::string_view, std::size_t>, 4> kAttitudeTypes{
    {{"QUATERNION", kPlain},
     {"QUATERNION/DERIVATIVE", kWithDerivative},
     {"QUATERNION/RATE", kWithRate},
     {"QUATERNION/ANGVEL", kWithRate}}};
constexpr std::array<std::pair<std::string_view, bool>, 2> kScalarFirst{{{"FIRST", true}, {"LAST", false}}};
constexpr std::array<std::pair<std::string_view, bool>, 2> kAToB{{{"A2B", true}, {"B2A", false}}};

bool is_body_frame(std::string_view frame) {
    return frame.starts_with("SC_BODY");
}

/// How a segment's quaternions become those from body to ICRF.
struct Convention {
    bool scalar_first = false, conjugated = false;
    Quat q_icrf_inertial{};

    [[nodiscard]] CourseValue apply(const double* v) const {
        Quat q = scalar_first ? Quat{v[0], v[1], v[2], v[3]} : Quat{v[3], v[0], v[1], v[2]};
        q = q_icrf_inertial * (conjugated ? conjugate(q) : q);
        return {q.w, q.x, q.y, q.z};
    }
};

Result<Convention> convention_of(const CcsdsMessage& message, const CcsdsSegment& segment) {
    const bool has_defaults = message.version != "1.0";  // version 2: from A to B, scalar last
    Convention convention;
    const auto first = message.choice(segment, "QUATERNION_TYPE", kScalarFirst,
                                      has_defaults ? std::optional(false) : std::nullopt);
    if (!first) return first.error();
    const auto a_to_b =
        message.choice(segment, "ATTITUDE_DIR", kAToB, has_defaults ? std::optional(true) : std::nullopt);
    if (!a_to_b) return a_to_b.error();
    const auto a = message.value(segment, "REF_FRAME_A"), b = message.value(segment, "REF_FRAME_B");
    if (!a) return a.error();
    if (!b) return b.error();
    if (is_body_frame(a->text) == is_body_frame(b->text))
        return message.error(
            b->number,
            fmt::format("attitude between {} and {}, expected one of them to be SC_BODY", a->text, b->text));
    const bool body_is_b = is_body_frame(b->text);
    const auto is_icrf = message.choice(segment, body_is_b ? "REF_FRAME_A" : "REF_FRAME_B", kInertialFrames);
    if (!is_icrf) return is_icrf.error();
    convention.scalar_first = *first;
    convention.conjugated = *a_to_b != body_is_b;
    if (!*is_icrf) convention.q_icrf_inertial = q_icrf_eme2000();
    return convention;
}

Result<CourseSegment> read_segment_of_attitudes(const CcsdsMessage& message, const CcsdsSegment& segment,
                                                const std::optional<Interpolation>& otherwise) {
    auto course = course_segment(message, segment, otherwise);
    if (!course) return course;
    const auto convention = convention_of(message, segment);
    if (!convention) return convention.error();
    const auto type = message.choice(segment, "ATTITUDE_TYPE", kAttitudeTypes);
    if (!type) return type.error();
    if (course->interpolation.method == Interpolation::Method::hermite && *type != kWithDerivative)
        return message.error(segment.line,
                             "HERMITE of quaternions without derivatives, expected ATTITUDE_TYPE = "
                             "QUATERNION/DERIVATIVE, or LAGRANGE or LINEAR");
    const auto system = message.choice(segment, "TIME_SYSTEM", kTimeSystems);
    for (const CcsdsLine& line : segment.data) {
        CourseSample sample{.line = line.number};
        const std::array counts{*type};
        const auto v = data_numbers(message, line, *system, counts, sample.t_ns);
        if (!v) return v.error();
        sample.value = convention->apply(v->data());
        if (*type == kWithDerivative) sample.rate_per_s = convention->apply(v->data() + kPlain);
        if (Status good = accept_quaternion(*course, sample); !good)
            return message.error(line.number, good.error().what);
        if (Status good = add_sample(message, *course, sample); !good) return good.error();
    }
    return course;
}

}  // namespace

Result<SampledCourse> read_aem(const std::string& path, const std::optional<Interpolation>& otherwise) {
    const auto message = read_ccsds_message(path, kAem);
    if (!message) return message.error();
    SampledCourse course{.file = path};
    for (const CcsdsSegment& segment : message->segments) {
        auto read = read_segment_of_attitudes(*message, segment, otherwise);
        if (!read) return read.error();
        if (Status good = check_samples(*read); !good) return message->error(good.error().line, good.error().what);
        course.segments.push_back(*std::move(read));
    }
    return course;
}

}  // namespace narpa
