// Orbit ephemeris messages, CCSDS 502.0-B, versions 1 to 3.
#include "renderer/trajectory/ccsds_message.h"

namespace narpa {
namespace {

constexpr std::array<std::string_view, 3> kOemVersions{"1.0", "2.0", "3.0"};
constexpr std::array<std::string_view, 12> kOemMetadata{
    "OBJECT_NAME",        "OBJECT_ID",         "CENTER_NAME",   "REF_FRAME",
    "REF_FRAME_EPOCH",    "TIME_SYSTEM",       "START_TIME",    "STOP_TIME",
    "USEABLE_START_TIME", "USEABLE_STOP_TIME", "INTERPOLATION", "INTERPOLATION_DEGREE"};
constexpr CcsdsKind kOem{.name = "OEM",
                         .what = "an orbit ephemeris message (CCSDS OEM)",
                         .versions = kOemVersions,
                         .metadata = kOemMetadata,
                         .method_key = "INTERPOLATION",
                         .data_start = {},
                         .data_stop = {},
                         .skipped_start = "COVARIANCE_START",
                         .skipped_stop = "COVARIANCE_STOP"};
constexpr std::array<std::size_t, 2> kOemColumns{6, 9};  ///< position, velocity and perhaps acceleration
constexpr double kMetres = 1e3;                          ///< of a km

Result<CourseSegment> read_segment(const CcsdsMessage& message, const CcsdsSegment& segment,
                                   const std::optional<Interpolation>& otherwise) {
    auto course = course_segment(message, segment, otherwise);
    if (!course) return course;
    const auto is_icrf = message.choice(segment, "REF_FRAME", kInertialFrames);
    if (!is_icrf) return is_icrf.error();
    const auto system = message.choice(segment, "TIME_SYSTEM", kTimeSystems);
    const Quat q_icrf = *is_icrf ? Quat{} : q_icrf_eme2000();
    for (const CcsdsLine& line : segment.data) {
        CourseSample sample{.line = line.number};
        const auto v = data_numbers(message, line, *system, kOemColumns, sample.t_ns);
        if (!v) return v.error();
        const Vec3 position = q_icrf * (kMetres * Vec3{(*v)[0], (*v)[1], (*v)[2]});
        const Vec3 velocity = q_icrf * (kMetres * Vec3{(*v)[3], (*v)[4], (*v)[5]});
        sample.value = {position.x, position.y, position.z, 0};
        sample.rate_per_s = {velocity.x, velocity.y, velocity.z, 0};
        if (Status good = add_sample(message, *course, sample); !good) return good.error();
    }
    return course;
}

}  // namespace

Result<SampledCourse> read_oem(const std::string& path, const std::optional<Interpolation>& otherwise) {
    const auto message = read_ccsds_message(path, kOem);
    if (!message) return message.error();
    SampledCourse course{.file = path};
    for (const CcsdsSegment& segment : message->segments) {
        auto read = read_segment(*message, segment, otherwise);
        if (!read) return read.error();
        if (Status good = check_samples(*read); !good) return message->error(good.error().line, good.error().what);
        const auto centre = message->value(segment, "CENTER_NAME");
        if (!centre) return centre.error();
        if (!course.centre.empty() && centre->text != course.centre)
            return message->error(centre->number, "another CENTER_NAME than before, expected " + course.centre);
        course.centre = centre->text;
        course.segments.push_back(*std::move(read));
    }
    return course;
}

}  // namespace narpa
