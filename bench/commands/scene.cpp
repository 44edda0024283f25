#include "bench/commands/scene.h"

#include <algorithm>
#include <filesystem>

#include "base/program_beside.h"
#include "renderer/camera/scene_camera.h"

namespace narpa::cli {

Result<std::string> shipped_scene(const std::string& name) {
    namespace fs = std::filesystem;
    std::error_code error;
    const fs::path program = program_folder();
    for (const char* folder : {"../scenes", "../share/narpa/scenes"})
        if (const fs::path file = (program / folder / name).lexically_normal(); fs::exists(file, error))
            return file.string();
    return Error{"is not beside the program, expected the name of a SCENE", name};
}

Result<Scene> scene_or_shipped(SceneArgument scene, const std::string& shipped,
                               std::optional<RenderSettings::Method> method) {
    if (scene.file.empty()) {
        auto found = shipped_scene(shipped);
        if (!found) return found.error();
        scene.file = *std::move(found);
    }
    return scene.load(method);
}

void resize(Camera& c, int width, int height) {
    const double x = static_cast<double>(width) / c.width, y = static_cast<double>(height) / c.height;
    c = scaled(c, x, y);
    c.width = width, c.height = height;
}

void resize_longer_side(Camera& c, int pixels) {
    const double scale = static_cast<double>(pixels) / std::max(c.width, c.height);
    resize(c, std::max(1, static_cast<int>(c.width * scale + 0.5)),
           std::max(1, static_cast<int>(c.height * scale + 0.5)));
}

}  // namespace narpa::cli
