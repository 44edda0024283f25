#include "emulator/log/run_record.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <limits>
#include <nlohmann/json.hpp>
#include <optional>

namespace narpa {
namespace {

using nlohmann::json;
using Method = RenderSettings::Method;

constexpr int kFormat = 1;  ///< raised when what is written changes its meaning
constexpr const char *kDirect = "direct", *kPath = "path";

std::string file_in(const std::string& folder) {
    return folder + "/run.json";
}

/// Takes values out of a document; remembers the first that is not as it should be.
class Reader {
public:
    Reader(std::string file, std::string text) : file_(std::move(file)), text_(std::move(text)) {
        try {
            document_ = json::parse(text_);
        } catch (const json::parse_error& e) {
            fail_at(e.byte > 0 ? e.byte - 1 : 0, "not JSON, expected the record of a run");
        }
    }

    std::uint64_t whole(const char* at, std::uint64_t least, std::uint64_t most) {
        const json* value = find(at);
        const bool good = value && value->is_number_unsigned() && value->get<std::uint64_t>() >= least &&
                          value->get<std::uint64_t>() <= most;
        if (good) return value->get<std::uint64_t>();
        fail(at, fmt::format("expected a whole number from {} to {}", least, most));
        return least;
    }
    std::string words(const char* at, std::initializer_list<std::string_view> expected = {}) {
        const json* value = find(at);
        const std::string text = value && value->is_string() ? value->get<std::string>() : "";
        const bool good = expected.size() == 0
                              ? !text.empty()
                              : std::find(expected.begin(), expected.end(), text) != expected.end();
        if (!good)
            fail(at, expected.size() == 0 ? "expected a name"
                                          : fmt::format("expected {}", fmt::join(expected, " or ")));
        return text;
    }
    [[nodiscard]] const std::optional<Error>& error() const { return error_; }

private:
    [[nodiscard]] const json* find(const char* at) const {
        const json::json_pointer pointer(at);
        return document_.contains(pointer) ? &document_.at(pointer) : nullptr;
    }
    /// Where the key stands; at the beginning, where there is none.
    void fail(const std::string& at, const std::string& what) {
        const std::string key = at.substr(at.rfind('/') + 1);
        const std::size_t found = text_.find('"' + key + '"');
        fail_at(found == std::string::npos ? 0 : found, key + ": " + what);
    }
    void fail_at(std::size_t offset, std::string what) {
        if (error_) return;
        const std::string_view before = std::string_view(text_).substr(0, offset);
        const auto line = 1 + static_cast<int>(std::count(before.begin(), before.end(), '\n'));
        const std::size_t start = before.rfind('\n');
        const std::size_t column = start == std::string_view::npos ? before.size() + 1 : before.size() - start;
        error_ = Error{std::move(what), file_, line, static_cast<int>(column)};
    }

    std::string file_, text_;
    json document_;
    std::optional<Error> error_;
};

}  // namespace

Status write_run_record(const std::string& folder, const Scene& scene) {
    std::error_code unknown;
    const std::filesystem::path file = std::filesystem::absolute(scene.file, unknown);
    const RenderSettings& r = scene.render;
    const json document{
        {"format", kFormat},
        {"scene", unknown ? scene.file : file.lexically_normal().string()},
        {"render",
         {{"method", r.method == Method::path ? kPath : kDirect}, {"max_depth", r.max_depth}, {"seed", r.seed}}}};
    std::ofstream out(file_in(folder));
    out << document.dump(2) << '\n';
    if (!out.flush()) return Error{"cannot be written", file_in(folder), 0, 0, ErrorKind::failed};
    return Ok{};
}

Result<RunRecord> read_run_record(const std::string& folder) {
    std::ifstream in(file_in(folder));
    if (!in) return Error{"is not there, expected the log folder of a run", file_in(folder)};
    Reader reader(file_in(folder), {std::istreambuf_iterator<char>(in), {}});
    (void)reader.whole("/format", kFormat, kFormat);
    RunRecord record;
    record.scene_file = reader.words("/scene");
    record.method = reader.words("/render/method", {kDirect, kPath}) == kPath ? Method::path : Method::direct;
    record.max_depth = static_cast<int>(reader.whole("/render/max_depth", 1, 40));
    record.seed = reader.whole("/render/seed", 0, std::numeric_limits<std::uint64_t>::max());
    if (reader.error()) return *reader.error();
    return record;
}

}  // namespace narpa
