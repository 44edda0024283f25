/// tests/support/paths.h - absolute paths of the sources and of the build folder.
///
/// The folders are compiled into paths.cpp alone, so that a compiler cache serves clones in different folders.
#pragma once

#include <string>
#include <string_view>

namespace narpa::test {

[[nodiscard]] std::string source_path(std::string_view below);
[[nodiscard]] std::string build_path(std::string_view below);

}  // namespace narpa::test
