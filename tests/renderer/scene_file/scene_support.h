/// tests/renderer/scene_file/scene_support.h - scene files with mistakes, and where files of tests are.
#pragma once

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <string>

#include "base/result.h"
#include "renderer/keys/toml_file.h"
#include "tests/support/paths.h"
#include "tests/support/read_file.h"
#include "tests/support/temporary_folder.h"

namespace narpa::test {

/// A file with a mistake, and the error that it gets.
struct BadFile {
    const char *name, *text;
    int line, column;   ///< 0: the file as a whole
    const char* words;  ///< that the message has
};
inline void PrintTo(const BadFile& bad, std::ostream* out) {
    *out << bad.name;
}
inline void expect_error_of(const BadFile& bad, const std::string& path, const Error& e) {
    EXPECT_EQ(e.kind, ErrorKind::bad_input);
    EXPECT_EQ(e.file, path);
    EXPECT_EQ(e.line, bad.line) << e.text();
    EXPECT_EQ(e.column, bad.column) << e.text();
    EXPECT_NE(e.what.find(bad.words), e.what.npos) << e.what;
}

/// In memory where there is such a place, as some tests write thousands of files.
class MemoryFolder : public TemporaryFolder {
public:
    MemoryFolder()
        : TemporaryFolder(access(kMemory, W_OK) == 0 ? kMemory : std::filesystem::temp_directory_path()) {}

private:
    static constexpr const char* kMemory = "/dev/shm";
};

/// What `read` makes of a text that is one table of a scene file with these keys. A problem is a failure.
template <class Read>
auto read_table(const std::string& text, const TableKeys& keys, const Read& read) {
    const MemoryFolder folder;
    const std::string path = folder.write("table.toml", text);
    const auto file = TomlFile::read(path, "scene", keys);
    Problems problems(path);
    TableReader table = file->root("the table", problems, &keys);
    auto out = read(table);
    table.finish();
    if (!problems.none()) ADD_FAILURE() << text << problems.first().text();
    return out;
}

inline std::string data_file(const std::string& name) {
    return test::source_path("tests/data/scenes/") + name;
}

/// A file of the folder of real meshes beside the project, which not every checkout has.
inline std::string asset_file(const std::string& name) {
    return test::source_path("../shared/assets/") + name;
}

}  // namespace narpa::test

#define NARPA_SKIP_WITHOUT(path) \
    if (!std::filesystem::exists(path)) GTEST_SKIP() << (path) << " is not there"
