#include "emulator/log/run_record.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <filesystem>
#include <functional>
#include <limits>
#include <nlohmann/json.hpp>
#include <optional>
#include <string_view>
#include <vector>

#include "base/file_bytes.h"
#include "base/fnv1a.h"
#include "base/write_file.h"
#include "emulator/log/calibration_document.h"
#include "renderer/keys/toml_file.h"
#include "renderer/scene_file/scene_file.h"
#include "renderer/scene_file/scene_inputs.h"

namespace narpa {
namespace {

using nlohmann::json;
using Method = RenderSettings::Method;

constexpr int kFormat = 1;  ///< increased when the format changes its meaning
constexpr const char *kDirect = "direct", *kPath = "path";

std::string file_in(const std::string& folder) {
    return folder + "/run.json";
}

/// An Error at this offset of the file's text.
Error error_at(const std::string& file, const std::string& text, std::size_t offset, std::string what) {
    const std::string_view before = std::string_view(text).substr(0, offset);
    const auto line = 1 + static_cast<int>(std::count(before.begin(), before.end(), '\n'));
    return {std::move(what), file, line, static_cast<int>(before.size() - (before.rfind('\n') + 1)) + 1};
}

/// A key and the check of its value.
struct Key {
    const char* at;  ///< JSON pointer
    std::function<bool(const json&)> is_good;
    std::string expected;
};

Key whole_number(const char* at, std::uint64_t least, std::uint64_t most) {
    return {at,
            [=](const json& v) {
                return v.is_number_unsigned() && v.get<std::uint64_t>() >= least && v.get<std::uint64_t>() <= most;
            },
            fmt::format("a whole number from {} to {}", least, most)};
}

/// Endings of the files that a run logs under the names of its sensors.
constexpr std::array<std::string_view, 7> kEndings{
    ".truth.csv", ".ledger.csv", ".estimate.csv", ".estimate.png", ".estimate.json", ".sweeps.csv", ".shots.csv"};
constexpr std::string_view kLedgerEnding = kEndings[1];

std::string absolute(const std::string& file) {
    std::error_code unknown;
    const std::filesystem::path whole = std::filesystem::absolute(file, unknown);
    return unknown ? file : whole.lexically_normal().string();
}

/// Empty if the file cannot be read.
std::optional<RecordedFile> recorded(const std::string& file) {
    const auto content = read_file(file);
    if (!content) return std::nullopt;
    return RecordedFile{absolute(file), content->size(), fnv1a(*content)};
}

json recorded_files(const Scene& scene) {
    json files = json::array();
    for (const std::string& file : files_of(scene))
        if (const auto f = recorded(file))
            files.push_back(
                {{"file", f->file}, {"size_b", f->size_b}, {"fnv1a", fmt::format("{:016x}", f->fnv1a)}});
    return files;
}

bool is_file_list(const json& files) {
    return files.is_array() && std::ranges::all_of(files, [](const json& f) {
               return f.is_object() && f.contains("file") && f["file"].is_string() && f.contains("size_b") &&
                      f["size_b"].is_number_unsigned() && f.contains("fnv1a") && f["fnv1a"].is_string();
           });
}

std::vector<RecordedFile> file_list(const json& files) {
    std::vector<RecordedFile> list;
    for (const json& f : files)
        list.push_back({f["file"], f["size_b"], std::strtoull(f["fnv1a"].get<std::string>().c_str(), nullptr, 16)});
    return list;
}

}  // namespace

Result<Scene> read_run_scene(const RunRecord& record, const std::string& scene_file) {
    auto scene = read_scene(scene_file.empty() ? record.scene_file : scene_file, record.overrides);
    if (!scene) return scene;
    if (auto good = use_method(*scene, record.method); !good) return good.error();
    scene->render.max_depth = record.max_depth;
    scene->render.seed = record.seed;
    return scene;
}

std::vector<std::string> changed_files(const RunRecord& record) {
    std::vector<std::string> changed;
    for (const RecordedFile& file : record.files)
        if (recorded(file.file) != file) changed.push_back(file.file);
    return changed;
}

Status remove_run(const std::string& folder) {
    namespace fs = std::filesystem;
    std::error_code failed;
    if (!fs::exists(file_in(folder), failed)) return Ok{};  // the files are not a run's
    if (const auto record = read_run_record(folder); !record) {
        Error error = record.error();
        error.what += "; the folder's files stay, expected a new folder or that of a run";
        return error;
    }
    std::vector<fs::path> files;
    for (const char* name : {"can.log", "scene.toml", "calibration.json"}) files.push_back(fs::path(folder) / name);
    for (fs::directory_iterator at(folder, failed), end; !failed && at != end; at.increment(failed)) {
        const std::string path = at->path();
        const auto is_of = [&](std::string_view ending) { return path.ends_with(ending); };
        if (std::ranges::any_of(kEndings, is_of)) files.emplace_back(path);
        if (is_of(kLedgerEnding))  // the camera's contact sheet
            files.emplace_back(path.substr(0, path.size() - kLedgerEnding.size()) + ".png");
    }
    files.emplace_back(file_in(folder));
    for (const fs::path& file : files) {
        if (fs::symlink_status(file, failed).type() != fs::file_type::regular) continue;
        if (!fs::remove(file, failed) && failed) return Error{"cannot be removed: " + failed.message(), file};
    }
    return Ok{};
}

Status write_run_record(const std::string& folder, const Scene& scene) {
    const auto text = TomlFile::read(scene.file, "scene", kSceneFileKeys, scene.overrides);
    if (!text) return text.error();
    if (Status written = write_file(folder + "/scene.toml", text->text() + '\n'); !written) return written;
    if (Status written = write_file(folder + "/calibration.json", calibration_document(scene)); !written)
        return written;
    const RenderSettings& r = scene.render;
    const json document{
        {"format", kFormat},
        {"scene", absolute(scene.file)},
        {"set", scene.overrides},
        {"files", recorded_files(scene)},
        {"render",
         {{"method", r.method == Method::path ? kPath : kDirect}, {"max_depth", r.max_depth}, {"seed", r.seed}}}};
    return write_file(file_in(folder), document.dump(2) + '\n');
}

Result<RunRecord> read_run_record(const std::string& folder) {
    const std::string file = file_in(folder);
    if (std::error_code failed; !std::filesystem::exists(file, failed))
        return Error{"is not there, expected the log folder of a run", file};
    const auto bytes = read_file(file);
    if (!bytes) return bytes.error();
    const std::string& text = *bytes;
    json document;
    try {
        document = json::parse(text);
    } catch (const json::parse_error& e) {
        return error_at(file, text, e.byte > 0 ? e.byte - 1 : 0, "not JSON, expected the record of a run");
    } catch (const json::exception& e) {  // a number beyond double
        return error_at(file, text, 0, e.what());
    }
    for (const auto& [at, is_good, expected] :
         {whole_number("/format", kFormat, kFormat),
          Key{"/scene", [](const json& v) { return v.is_string() && v != ""; }, "a name"},
          Key{"/render/method", [](const json& v) { return v == kDirect || v == kPath; }, "direct or path"},
          Key{"/files", is_file_list, "an array of {file, size_b, fnv1a}"},
          whole_number("/render/max_depth", 1, 40),
          whole_number("/render/seed", 0, std::numeric_limits<std::uint64_t>::max())}) {
        const json::json_pointer pointer(at);
        if (document.contains(pointer) ? is_good(document.at(pointer)) : pointer.back() == "files") continue;
        const std::size_t found = text.find('"' + pointer.back() + '"');
        return error_at(file, text, found == std::string::npos ? 0 : found,
                        pointer.back() + ": expected " + expected);
    }
    const json set = document.value("set", json::array());  // logs of earlier versions have none
    if (!set.is_array() || !std::ranges::all_of(set, [](const json& v) { return v.is_string(); }))
        return error_at(file, text, text.find("\"set\""), "set: expected an array of texts, KEY=VALUE");
    const json& render = document["render"];
    return RunRecord{document["scene"],
                     set.get<std::vector<std::string>>(),
                     render["method"] == kPath ? Method::path : Method::direct,
                     render["max_depth"],
                     render["seed"],
                     document.contains("files") ? file_list(document["files"]) : std::vector<RecordedFile>()};
}

}  // namespace narpa
