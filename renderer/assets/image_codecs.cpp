#include "renderer/assets/image_codecs.h"

#include <dlfcn.h>

namespace narpa {
namespace {

/// Names by the C++ ABI of GCC and Clang (Itanium): cv::imdecode(InputArray, int) and
/// cv::imencode(const std::string&, InputArray, std::vector<uchar>&, const std::vector<int>&).
constexpr const char* kDecode = "_ZN2cv8imdecodeERKNS_11_InputArrayEi";
constexpr const char* kEncode =
    "_ZN2cv8imencodeERKNSt7__cxx1112basic_stringIcSt11char_traitsIcESaIcEEE"  // const std::string&
    "RKNS_11_InputArrayERSt6vectorIhSaIhEERKSB_IiSaIiEE";

struct Loaded {
    ImageCodecs codecs;
    std::string problem;  ///< empty: none
};

Loaded load() {
    Loaded l;
    const auto found = [&](void* p) {
        if (p == nullptr && l.problem.empty()) l.problem = dlerror();
        return p;
    };
    void* library = found(dlopen(NARPA_OPENCV_IMGCODECS, RTLD_LAZY | RTLD_LOCAL));
    if (library == nullptr) return l;
    l.codecs.imdecode = reinterpret_cast<decltype(ImageCodecs::imdecode)>(found(dlsym(library, kDecode)));
    l.codecs.imencode = reinterpret_cast<decltype(ImageCodecs::imencode)>(found(dlsym(library, kEncode)));
    return l;
}

}  // namespace

Result<ImageCodecs> image_codecs(const std::string& file) {
    static const Loaded loaded = load();
    if (loaded.problem.empty()) return loaded.codecs;
    return Error{.what = "images need OpenCV's library of codecs, which cannot be loaded: " + loaded.problem,
                 .file = file,
                 .kind = ErrorKind::missing};
}

}  // namespace narpa
