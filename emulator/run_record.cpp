#include "emulator/run_record.h"

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

namespace narpa {
namespace {

using nlohmann::json;
using Method = RenderSettings::Method;

constexpr int kFormat = 1;  ///< raised when what is written changes its meaning

std::string file_in(const std::string& folder) {
    return folder + "/run.json";
}

}  // namespace

Status write_run_record(const std::string& folder, const Scene& scene) {
    std::error_code unknown;
    const std::filesystem::path file = std::filesystem::absolute(scene.file, unknown);
    const RenderSettings& r = scene.render;
    const json document{{"format", kFormat},
                        {"scene", unknown ? scene.file : file.lexically_normal().string()},
                        {"render",
                         {{"method", r.method == Method::path ? "path" : "direct"},
                          {"max_depth", r.max_depth},
                          {"spp", r.spp},
                          {"budget_ns", r.budget_ns},
                          {"budget_rays", r.budget_rays},
                          {"seed", r.seed},
                          {"stale_after_s", r.stale_after_s}}}};
    std::ofstream out(file_in(folder));
    out << document.dump(2) << '\n';
    if (!out.flush()) return Error{"cannot be written", file_in(folder), 0, 0, ErrorKind::failed};
    return Ok{};
}

Result<RunRecord> read_run_record(const std::string& folder) {
    const auto bad = [&](const std::string& what) { return Error{what, file_in(folder)}; };
    std::ifstream in(file_in(folder));
    if (!in) return bad("is not there, expected the log folder of a run");
    try {
        const json document = json::parse(in);
        if (document.at("format").get<int>() != kFormat)
            return bad("is of format " + std::to_string(document.at("format").get<int>()) + ", expected " +
                       std::to_string(kFormat));
        const json& r = document.at("render");
        RunRecord record;
        record.scene_file = document.at("scene").get<std::string>();
        record.render.method = r.at("method").get<std::string>() == "path" ? Method::path : Method::direct;
        record.render.max_depth = r.at("max_depth").get<int>();
        record.render.spp = r.at("spp").get<int>();
        record.render.budget_ns = r.at("budget_ns").get<std::int64_t>();
        record.render.budget_rays = r.at("budget_rays").get<std::uint64_t>();
        record.render.seed = r.at("seed").get<std::uint64_t>();
        record.render.stale_after_s = r.at("stale_after_s").get<double>();
        if (record.render.spp < 1 || record.render.max_depth < 1 || record.render.max_depth > 40)
            return bad("spp or max_depth is out of range");
        return record;
    } catch (const json::exception& e) {
        return bad(std::string("cannot be read as the record of a run: ") + e.what());
    }
}

}  // namespace narpa
