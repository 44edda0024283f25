#include "apps/outputs.h"

#include <algorithm>
#include <filesystem>

#include "renderer/scene_file/scene_inputs.h"

namespace narpa::cli {
namespace {

bool exists(const std::string& file) {
    std::error_code unknown;
    return std::filesystem::exists(file, unknown);
}

bool is_one_of(const std::string& file, const std::vector<std::string>& files) {
    return std::ranges::any_of(files, [&](const std::string& other) {
        std::error_code unknown;
        return std::filesystem::equivalent(file, other, unknown);
    });
}

}  // namespace

Status keep_inputs(const std::vector<std::string>& outputs, const std::vector<std::string>& inputs) {
    for (const std::string& output : outputs)
        if (is_one_of(output, inputs))
            return Error{"would be replaced, but this command reads it; expected another name for the output",
                         output};
    return Ok{};
}

Status keep_inputs(const std::vector<std::string>& outputs, const Scene& scene, std::vector<std::string> others) {
    if (std::ranges::none_of(outputs, exists)) return Ok{};
    const std::vector<std::string> files = files_of(scene);
    others.insert(others.end(), files.begin(), files.end());
    return keep_inputs(outputs, others);
}

}  // namespace narpa::cli
