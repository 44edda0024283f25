/// renderer/trajectory/ccsds_message.h - the key-value notation (KVN) of CCSDS navigation messages: orbit
/// ephemerides (OEM, CCSDS 502.0-B) and attitude ephemerides (AEM, CCSDS 504.0-B).
#pragma once

#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/result.h"
#include "base/text/text_lines.h"
#include "renderer/ephemeris/time_systems.h"
#include "renderer/trajectory/sampled_course.h"

namespace narpa {

/// What differs between the two.
struct CcsdsKind {
    std::string_view name;                             ///< "OEM"
    std::string_view what;                             ///< "an orbit ephemeris message (CCSDS OEM)"
    std::span<const std::string_view> versions;        ///< that are known
    std::span<const std::string_view> metadata;        ///< keywords between META_START and META_STOP
    std::string_view method_key;                       ///< keyword of the interpolation's method
    std::string_view data_start, data_stop;            ///< around the data; empty: nothing is
    std::string_view skipped_start{}, skipped_stop{};  ///< around what is not read
};

struct CcsdsLine {
    std::string_view text;
    int number = 0;
};

struct CcsdsSegment {
    int line = 0;
    std::map<std::string_view, CcsdsLine> metadata{};  ///< values by keyword
    std::vector<CcsdsLine> data{};
};

struct CcsdsMessage {
    const CcsdsKind* kind = nullptr;
    std::string file, version;
    std::unique_ptr<TextLines> lines{};  ///< owns the texts
    std::vector<CcsdsSegment> segments{};

    [[nodiscard]] Error error(int line, std::string what) const { return {std::move(what), file, line, 1}; }
    /// A value of a segment's metadata; the Error names the keyword.
    [[nodiscard]] Result<CcsdsLine> value(const CcsdsSegment& segment, std::string_view keyword) const;
    /// One of a few names; `otherwise` where the keyword is absent, an Error without it.
    template <class T, std::size_t N>
    Result<T> choice(const CcsdsSegment& segment, std::string_view keyword,
                     const std::array<std::pair<std::string_view, T>, N>& names,
                     std::optional<T> otherwise = std::nullopt) const {
        if (otherwise && !segment.metadata.contains(keyword)) return *otherwise;
        const Result<CcsdsLine> found = value(segment, keyword);
        if (!found) return found.error();
        std::string expected;
        for (const auto& [name, meaning] : names) {
            if (found->text == name) return meaning;
            expected += (expected.empty() ? "" : ", ") + std::string(name);
        }
        return error(found->number, std::string(keyword) + " = " + std::string(found->text) + ", expected " +
                                        (N > 1 ? "one of " : "") + expected);
    }
};

/// Inertial frames, and whether they are ICRF (else EME2000).
inline constexpr std::array<std::pair<std::string_view, bool>, 4> kInertialFrames{
    {{"ICRF", true}, {"GCRF", true}, {"EME2000", false}, {"J2000", false}}};

/// Comments are left out. Errors: of another kind or version, XML, keywords that the kind does not have, no
/// segment.
Result<CcsdsMessage> read_ccsds_message(const std::string& path, const CcsdsKind& kind);

/// A segment without samples: times and interpolation. `otherwise`: where the file states no interpolation.
Result<CourseSegment> course_segment(const CcsdsMessage& message, const CcsdsSegment& segment,
                                     const std::optional<Interpolation>& otherwise);
/// Time and `count` numbers, `most` at most, of a line of data.
Result<std::vector<double>> data_numbers(const CcsdsMessage& message, const CcsdsLine& line, TimeSystem system,
                                         std::span<const std::size_t> counts, std::int64_t& t_ns);
/// Adds a sample; the Error says that its time does not come after that of the last.
Status add_sample(const CcsdsMessage& message, CourseSegment& segment, const CourseSample& sample);

/// Positions and velocities of an OEM, m and m/s in ICRF. Accelerations and covariances are not used.
Result<SampledCourse> read_oem(const std::string& path, const std::optional<Interpolation>& otherwise);
/// Attitudes of an AEM, body to ICRF. Angular velocities are not used: they are the derivative of the attitudes.
Result<SampledCourse> read_aem(const std::string& path, const std::optional<Interpolation>& otherwise);

/// What a file of poses is by its first line that is no comment: "OEM", "AEM" or "XML", or "TOML" with a table
/// [trajectory]; empty: none of these, or no regular file (a pipe can be read only once).
[[nodiscard]] std::string_view format_of_poses(const std::string& path);

}  // namespace narpa
