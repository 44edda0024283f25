#include "apps/scene_argument.h"

#include "apps/progress.h"
#include "apps/warnings.h"
#include "renderer/keys/shipped_file.h"
#include "renderer/scene_file/scene_file.h"

namespace narpa::cli {

void SceneArgument::add_to(Parser app) {
    app.option("SCENE", file, "Scene file (TOML), or a name that `narpa list` shows").required();
    add_settings_to(app);
}

void SceneArgument::add_settings_to(Parser app) {
    add_set_to(app, sets);
    add_strict_to(app);
}

Option SceneArgument::add_set_to(Parser app, std::vector<std::string>& sets) {
    return app
        .option("--set", sets,
                "Value of a key in place of the file's, as camera.nav.detector.exposure_s=0.002; may be given many "
                "times")
        .type_name("KEY=VALUE")
        .values(1, 1)
        .repeatable();
}

Result<Scene> SceneArgument::load_anyway(std::optional<RenderSettings::Method> method) const {
    const auto path = find_file(FileKind::scene, file);
    if (!path) return path.error();
    auto scene = [&] {
        const Progress progress("reading " + *path);
        return read_scene(*path, sets);
    }();
    if (!scene) return scene;
    if (method)
        if (const Status good = use_method(*scene, *method); !good) return good.error();
    for (const std::string& w : scene->warnings) warn(w);
    return scene;
}

Result<Scene> SceneArgument::load(std::optional<RenderSettings::Method> method) const {
    auto scene = load_anyway(method);
    if (!scene) return scene;
    if (const Status good = check_warnings(scene->file); !good) return good.error();
    return scene;
}

}  // namespace narpa::cli
