#include "tests/support/paths.h"

namespace narpa::test {

std::string source_path(std::string_view below) {
    return std::string(NARPA_SOURCE_DIR "/").append(below);
}

std::string build_path(std::string_view below) {
    return std::string(NARPA_BUILD_DIR "/").append(below);
}

}  // namespace narpa::test
