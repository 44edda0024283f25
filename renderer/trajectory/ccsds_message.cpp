#include "renderer/trajectory/ccsds_message.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>

#include "base/text/csv.h"

namespace narpa {
namespace {

constexpr std::array<std::string_view, 4> kHeaderKeywords{"CREATION_DATE", "ORIGINATOR", "MESSAGE_ID",
                                                          "CLASSIFICATION"};

std::vector<std::string_view> words_of(std::string_view text) {
    std::vector<std::string_view> words;
    while (!(text = trimmed(text)).empty()) {
        const std::size_t end = std::min(text.find_first_of(" \t"), text.size());
        words.push_back(text.substr(0, end));
        text.remove_prefix(end);
    }
    return words;
}

bool is_comment(std::string_view line) {
    return line.empty() || line == "COMMENT" || line.starts_with("COMMENT ");
}

/// The lines of a message, one part after the other.
class CcsdsReader {
public:
    explicit CcsdsReader(CcsdsMessage& message) : message_(message), kind_(*message.kind) {}

    Status read() {
        if (Status good = read_version(); !good) return good;
        if (Status good = read_header(); !good) return good;
        while (line_.text == "META_START") {
            message_.segments.emplace_back().line = line_.number;
            if (Status good = read_metadata(); !good) return good;
            if (Status good = read_data(); !good) return good;
        }
        if (!at_end_) return unexpected("META_START, or the end of the file");
        if (message_.segments.empty()) return message_.error(line_.number, "no META_START, expected a segment");
        return Ok{};
    }

private:
    /// Steps to the next line that is no comment; an empty one at the end.
    void next() {
        std::string_view text;
        while (message_.lines->next(text))
            if (text = trimmed(text); !is_comment(text)) {
                line_ = {text, message_.lines->number()};
                return;
            }
        at_end_ = true;
        line_.text = {};
    }
    Error unexpected(std::string_view expected) const {
        return at_end_ ? message_.error(line_.number, fmt::format("ends here, expected {}", expected))
                       : message_.error(line_.number, fmt::format("\"{}\", expected {}", line_.text, expected));
    }
    /// KEYWORD = VALUE [unit] of the line.
    Result<std::pair<std::string_view, CcsdsLine>> entry(std::span<const std::string_view> keywords) const {
        const std::size_t equals = line_.text.find('=');
        if (equals == std::string_view::npos) return unexpected("KEYWORD = VALUE");
        const std::string_view keyword = trimmed(line_.text.substr(0, equals));
        std::string_view value = trimmed(line_.text.substr(equals + 1));
        if (std::ranges::find(keywords, keyword) == keywords.end())
            return message_.error(line_.number, fmt::format("unknown keyword {}, expected one of {}", keyword,
                                                            fmt::join(keywords, ", ")));
        if (value.ends_with(']')) value = trimmed(value.substr(0, value.rfind('[')));
        if (value.empty()) return message_.error(line_.number, fmt::format("{} has no value", keyword));
        return std::pair{keyword, CcsdsLine{value, line_.number}};
    }

    Status read_version() {
        next();
        const std::string keyword = fmt::format("CCSDS_{}_VERS", kind_.name);
        if (line_.text.starts_with("<"))
            return unexpected(keyword + ": XML is not read, expected the notation KVN");
        const std::array keywords{std::string_view(keyword)};
        auto first = entry(keywords);
        if (!first) return message_.error(line_.number, fmt::format("expected {}: {} = ...", kind_.what, keyword));
        message_.version = first->second.text;
        if (std::ranges::find(kind_.versions, message_.version) == kind_.versions.end())
            return message_.error(line_.number, fmt::format("{} = {}, expected one of {}", keyword,
                                                            message_.version, fmt::join(kind_.versions, ", ")));
        next();
        return Ok{};
    }
    Status read_header() {
        for (; !at_end_ && line_.text != "META_START"; next())
            if (auto read = entry(kHeaderKeywords); !read) return read.error();
        return Ok{};
    }
    Status read_metadata() {
        CcsdsSegment& segment = message_.segments.back();
        for (next(); line_.text != "META_STOP"; next()) {
            if (at_end_) return unexpected("META_STOP");
            const auto read = entry(kind_.metadata);
            if (!read) return read.error();
            if (!segment.metadata.insert(*read).second)
                return message_.error(line_.number, fmt::format("{} a second time", read->first));
        }
        next();
        return Ok{};
    }
    Status read_data() {
        CcsdsSegment& segment = message_.segments.back();
        if (!kind_.data_start.empty()) {
            if (line_.text != kind_.data_start) return unexpected(kind_.data_start);
            next();
        }
        for (; !at_end_ && line_.text != kind_.data_stop && line_.text != "META_START"; next()) {
            if (!kind_.skipped_start.empty() && line_.text == kind_.skipped_start) {
                while (!at_end_ && line_.text != kind_.skipped_stop) next();
                if (at_end_) return unexpected(kind_.skipped_stop);
                continue;
            }
            segment.data.push_back(line_);
        }
        if (kind_.data_stop.empty()) return Ok{};
        if (line_.text != kind_.data_stop) return unexpected(kind_.data_stop);
        next();
        return Ok{};
    }

    CcsdsMessage& message_;
    const CcsdsKind& kind_;
    CcsdsLine line_{};
    bool at_end_ = false;
};

/// Time of a keyword; `otherwise` where it is absent.
Result<std::int64_t> time_of(const CcsdsMessage& message, const CcsdsSegment& segment, std::string_view keyword,
                             TimeSystem system, std::optional<std::int64_t> otherwise = std::nullopt) {
    if (otherwise && !segment.metadata.contains(keyword)) return *otherwise;
    const auto value = message.value(segment, keyword);
    if (!value) return value.error();
    const auto t_ns = tai_ns(value->text, system);
    if (!t_ns) return message.error(value->number, fmt::format("{} = {}", keyword, t_ns.error().what));
    return *t_ns;
}

Result<Interpolation> interpolation_of(const CcsdsMessage& message, const CcsdsSegment& segment,
                                       const std::optional<Interpolation>& otherwise) {
    const std::string_view key = message.kind->method_key;
    if (!segment.metadata.contains(key)) {
        if (otherwise) return *otherwise;
        return message.error(segment.line,
                             fmt::format("the segment has no {}, expected it here, or `interpolation` and `degree` "
                                         "in the file that names this one",
                                         key));
    }
    Interpolation result;
    const auto method = message.choice(segment, key, Interpolation::kMethods);
    if (!method) return method.error();
    result.method = *method;
    if (result.method == Interpolation::Method::linear && !segment.metadata.contains("INTERPOLATION_DEGREE"))
        return result;
    const auto degree = message.value(segment, "INTERPOLATION_DEGREE");
    if (!degree) return degree.error();
    const auto number = number_from(degree->text);
    result.degree =
        number && *number == std::floor(*number) && std::abs(*number) < 1e6 ? static_cast<int>(*number) : 0;
    if (const std::string problem = result.problem(); !problem.empty())
        return message.error(degree->number, fmt::format("INTERPOLATION_DEGREE = {}, {}", degree->text, problem));
    return result;
}

}  // namespace

Result<CcsdsLine> CcsdsMessage::value(const CcsdsSegment& segment, std::string_view keyword) const {
    const auto found = segment.metadata.find(keyword);
    if (found != segment.metadata.end()) return found->second;
    return error(segment.line, fmt::format("the segment has no {}", keyword));
}

std::string_view format_of_poses(const std::string& path) {
    if (std::error_code unknown; !std::filesystem::is_regular_file(path, unknown)) return {};
    std::ifstream in(path);
    bool is_toml = false;
    for (std::string text; std::getline(in, text);) {
        std::string_view line = text;
        if (line.starts_with("\xef\xbb\xbf")) line.remove_prefix(3);  // byte order mark
        if (line.ends_with('\r')) line.remove_suffix(1);
        line = trimmed(line);
        if (is_comment(line) || line.starts_with('#')) continue;
        if (line.starts_with("[trajectory]")) return "TOML";
        is_toml |= line.starts_with('[');
        if (is_toml) continue;  // [trajectory] may come later
        for (const auto& [begin, format] :
             {std::pair{"CCSDS_OEM_VERS", "OEM"}, {"CCSDS_AEM_VERS", "AEM"}, {"<?xml", "XML"}})
            if (line.starts_with(begin)) return format;
        break;
    }
    return {};
}

Result<CcsdsMessage> read_ccsds_message(const std::string& path, const CcsdsKind& kind) {
    std::ifstream in(path);
    if (!in) return Error{fmt::format("cannot be opened ({}), expected {}", std::strerror(errno), kind.what), path};
    CcsdsMessage message{.kind = &kind, .file = path, .version = {}, .lines = std::make_unique<TextLines>(in)};
    if (Status read = CcsdsReader(message).read(); !read) return read.error();
    const CcsdsSegment& first = message.segments.front();
    for (const CcsdsSegment& segment : message.segments) {
        const auto name = message.value(first, "OBJECT_NAME"), own = message.value(segment, "OBJECT_NAME");
        if (!name) return name.error();
        if (!own) return own.error();
        if (own->text != name->text)
            return message.error(own->number, fmt::format("OBJECT_NAME = {}, expected {} as in line {}: one object",
                                                          own->text, name->text, name->number));
    }
    return message;
}

Result<CourseSegment> course_segment(const CcsdsMessage& message, const CcsdsSegment& segment,
                                     const std::optional<Interpolation>& otherwise) {
    CourseSegment course;
    course.line = segment.line;
    const auto system = message.choice(segment, "TIME_SYSTEM", kTimeSystems);
    if (!system) return system.error();
    const auto interpolation = interpolation_of(message, segment, otherwise);
    if (!interpolation) return interpolation.error();
    course.interpolation = *interpolation;
    auto from = time_of(message, segment, "START_TIME", *system);
    if (from) from = time_of(message, segment, "USEABLE_START_TIME", *system, *from);
    if (!from) return from.error();
    auto to = time_of(message, segment, "STOP_TIME", *system);
    if (to) to = time_of(message, segment, "USEABLE_STOP_TIME", *system, *to);
    if (!to) return to.error();
    course.from_ns = *from;
    course.to_ns = *to;
    if (*to < *from) return message.error(segment.line, "the segment stops before it starts");
    return course;
}

Result<std::vector<double>> data_numbers(const CcsdsMessage& message, const CcsdsLine& line, TimeSystem system,
                                         std::span<const std::size_t> counts, std::int64_t& t_ns) {
    const std::vector<std::string_view> words = words_of(line.text);
    const auto t = tai_ns(words.front(), system);
    if (!t) return message.error(line.number, t.error().what);
    t_ns = *t;
    if (std::ranges::find(counts, words.size() - 1) == counts.end())
        return message.error(line.number, fmt::format("{} numbers behind the time, expected {}", words.size() - 1,
                                                      fmt::join(counts, " or ")));
    std::vector<double> numbers;
    for (std::size_t i = 1; i < words.size(); ++i) {
        const auto number = number_from(words[i]);
        if (!number || !std::isfinite(*number))
            return Error{fmt::format("\"{}\" where a finite number was expected", words[i]), message.file,
                         line.number, static_cast<int>(words[i].data() - line.text.data()) + 1};
        numbers.push_back(*number);
    }
    return numbers;
}

Status add_sample(const CcsdsMessage& message, CourseSegment& segment, const CourseSample& sample) {
    if (!segment.samples.empty() && sample.t_ns <= segment.samples.back().t_ns)
        return message.error(
            sample.line, fmt::format("the time does not come after that of line {}", segment.samples.back().line));
    segment.samples.push_back(sample);
    return Ok{};
}

}  // namespace narpa
