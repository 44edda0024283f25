// The image formats of textures.
#include "renderer/assets/images/texture_file.h"
#include "tests/fuzz/fuzz.h"

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    using namespace narpa;
    const Result<Texture> t = decode_texture("t", {data, size}, {});
    if (!fuzz::count(bool(t))) return fuzz::require(!t.error().what.empty(), "an error has words"), 0;
    fuzz::require(t->width > 0 && t->height > 0 &&
                      t->rgb.size() == 3 * static_cast<std::size_t>(t->width) * static_cast<std::size_t>(t->height),
                  "a texture has all its texels");
    return 0;
}
