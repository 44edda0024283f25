#include "renderer/scene/image_codecs.h"

#include <dlfcn.h>

namespace narpa {
namespace {

/// Names by the C++ ABI of GCC and Clang (Itanium): cv::imdecode(InputArray, int) and
/// cv::imencode(const std::string&, InputArray, std::vector<uchar>&, const std::vector<int>&).
constexpr const char* kDecode = "_ZN2cv8imdecodeERKNS_11_InputArrayEi";
constexpr const char* kEncode =
    "_ZN2cv8imencodeERKNSt7__cxx1112basic_stringIcSt11char_traitsIcESaIcEEERKNS_11_"
    "InputArrayERSt6vectorIhSaIhEERKSB_"
    "IiSaIiEE";

Result<ImageCodecs> load() {
    const Error none{.what = "image files need OpenCV's codecs, which cannot be loaded: ",
                     .kind = ErrorKind::missing};
    const auto error = [&] {
        const char* reason = dlerror();
        Error e = none;
        e.what += reason != nullptr ? reason : "no reason given";
        return e;
    };
    void* library = dlopen(NARPA_OPENCV_IMGCODECS, RTLD_LAZY | RTLD_LOCAL);
    if (library == nullptr) return error();
    ImageCodecs codecs{reinterpret_cast<decltype(ImageCodecs::imdecode)>(dlsym(library, kDecode)),
                       reinterpret_cast<decltype(ImageCodecs::imencode)>(dlsym(library, kEncode))};
    if (codecs.imdecode == nullptr || codecs.imencode == nullptr) return error();
    return codecs;
}

}  // namespace

Result<ImageCodecs> image_codecs() {
    static const Result<ImageCodecs> codecs = load();
    return codecs;
}

}  // namespace narpa
