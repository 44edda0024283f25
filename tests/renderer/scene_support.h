/// tests/renderer/scene_support.h - files in a folder of their own, for tests of readers.
#pragma once

#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <string_view>

namespace narpa::test {

/// A scene file with a mistake, and the error that it gets.
struct BadScene {
    const char *name, *text;
    int line, column;
    const char* words;  ///< that the message has
};
inline void PrintTo(const BadScene& bad, std::ostream* out) {
    *out << bad.name;
}

/// A new folder that goes when the test ends; in memory where there is such a place, as some tests write thousands
/// of files.
class TemporaryFolder {
public:
    TemporaryFolder() {
        const std::filesystem::path memory = "/dev/shm";
        const bool in_memory = access(memory.c_str(), W_OK) == 0;
        std::string pattern =
            ((in_memory ? memory : std::filesystem::temp_directory_path()) / "narpa-test-XXXXXX").string();
        path_ = mkdtemp(pattern.data());
    }
    TemporaryFolder(const TemporaryFolder&) = delete;
    TemporaryFolder& operator=(const TemporaryFolder&) = delete;
    ~TemporaryFolder() { std::filesystem::remove_all(path_); }

    /// Writes a file and gives its path.
    std::string write(const std::string& name, std::string_view text) const {
        const std::string file = (path_ / name).string();
        std::ofstream(file, std::ios::binary) << text;
        return file;
    }
    [[nodiscard]] std::string operator/(const std::string& name) const { return (path_ / name).string(); }

private:
    std::filesystem::path path_;
};

inline std::string read_text(const std::string& path) {
    std::ifstream in(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(in), {}};
}

inline std::string data_file(const std::string& name) {
    return NARPA_SOURCE_DIR "/tests/data/scenes/" + name;
}

/// A file of the folder of real meshes beside the project, which not every checkout has.
inline std::string asset_file(const std::string& name) {
    return NARPA_SOURCE_DIR "/../shared/assets/" + name;
}

}  // namespace narpa::test

#define NARPA_SKIP_WITHOUT(path) \
    if (!std::filesystem::exists(path)) GTEST_SKIP() << (path) << " is not there"
