#include "apps/commands/calibration.h"

#include <filesystem>

#include "base/write_file.h"
#include "emulator/log/calibration_document.h"
#include "renderer/assets/calibration_file.h"
#include "renderer/scene/scene.h"

namespace narpa::cli {

Status write_calibration(const Scene& scene, const std::string& folder) {
    std::error_code failed;
    std::filesystem::create_directories(folder, failed);
    if (failed) return Error{"cannot be made: " + failed.message(), folder};
    for (const Camera& c : scene.cameras) {
        const Result<std::string> text = calibration_text(c.name, {c.width, c.height, c.model});
        if (!text) return text.error();
        if (Status good = write_file(folder + "/" + c.name + ".yaml", *text); !good) return good;
    }
    return write_file(folder + "/calibration.json", calibration_document(scene));
}

}  // namespace narpa::cli
