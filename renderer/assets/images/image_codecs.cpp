#include "renderer/assets/images/image_codecs.h"

#include <dlfcn.h>

#include "base/program_beside.h"

namespace narpa {
namespace {

struct Loaded {
    const ImageCodecs* codecs = nullptr;
    std::string problem;
};

Loaded load() {
    Loaded l;
    if (void* library = dlopen(library_beside("narpa-image-codecs.so").c_str(), RTLD_LAZY | RTLD_LOCAL))
        l.codecs = static_cast<const ImageCodecs*>(dlsym(library, "narpa_image_codecs"));
    if (l.codecs == nullptr) l.problem = dlerror();
    return l;
}

}  // namespace

Result<ImageCodecs> image_codecs(const std::string& file) {
    static const Loaded loaded = load();
    if (loaded.codecs != nullptr) return *loaded.codecs;
    return Error{.what = "images need OpenCV's library of codecs, which cannot be loaded: " + loaded.problem,
                 .file = file,
                 .kind = ErrorKind::missing};
}

}  // namespace narpa
