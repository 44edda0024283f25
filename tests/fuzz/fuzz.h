/// tests/fuzz/fuzz.h - what fuzz targets share. Each target is a program that defines LLVMFuzzerTestOneInput:
/// driver.cpp calls it, or clang's libFuzzer.
#pragma once

#include <unistd.h>

#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>
#include <string_view>

#include "tests/support/paths.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);

namespace narpa::fuzz {

/// Ends the program where a reader let through what it must not.
inline void require(bool holds, const char* what) {
    if (holds) return;
    std::fprintf(stderr, "fuzz: does not hold: %s\n", what);
    std::abort();
}

/// What the target's reader has taken and refused: driver.cpp ends with an error where it never did one of them, as
/// then the target tests nothing.
inline std::uint64_t taken = 0, refused = 0;
inline bool count(bool is_taken) {
    ++(is_taken ? taken : refused);
    return is_taken;
}

inline std::string_view text_of(const std::uint8_t* data, std::size_t size) {
    return {reinterpret_cast<const char*>(data), size};
}

/// Prints what a reader said, where the environment variable NARPA_FUZZ_NOTES is set: to count crashes that a
/// process of its own keeps from being ours.
inline void note(const std::string& what) {
    static const bool wanted = std::getenv("NARPA_FUZZ_NOTES") != nullptr;
    if (wanted) std::printf("note: %s\n", what.c_str());
}

/// A folder for readers of files, in memory where there is such a place; removed when the program ends.
class InputFolder {
public:
    InputFolder() {
        const bool in_memory = ::access("/dev/shm", W_OK) == 0;
        std::string pattern = std::string(in_memory ? "/dev/shm" : "/tmp") + "/narpa-fuzz-XXXXXX";
        if (::mkdtemp(pattern.data()) == nullptr) std::abort();
        path_ = pattern;
    }
    InputFolder(const InputFolder&) = delete;
    InputFolder& operator=(const InputFolder&) = delete;
    ~InputFolder() {
        std::error_code ignored;
        std::filesystem::remove_all(path_, ignored);
    }

    [[nodiscard]] std::string operator/(const std::string& name) const { return path_ + "/" + name; }
    [[nodiscard]] const std::string& path() const { return path_; }
    /// Writes a file and returns its path.
    std::string write(const std::string& name, std::string_view bytes) const {
        std::string file = *this / name;
        std::ofstream(file, std::ios::binary).write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
        return file;
    }
    /// Files of tests/data/scenes that seeds name.
    void copy_scene_data() const {
        for (const char* name : {"cube.obj", "cube.mtl", "checker.ppm", "normals.ppm", "stars.csv"})
            std::filesystem::copy_file(test::source_path("tests/data/scenes/") + name, *this / name);
    }

private:
    std::string path_;
};

}  // namespace narpa::fuzz
