#include "plot/plot.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <array>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "tests/support/temporary_folder.h"

namespace narpa {
namespace {

const nlohmann::json kDocument{{"plot", "loop"},
                               {"title", "one camera"},
                               {"runs",
                                {{{"name", "idle"},
                                  {"cameras",
                                   {{{"name", "nav"},
                                     {"wake_late_ms", {{0.01, 1.0}, {0.5, 0.1}}},
                                     {"hand_over_ms", {{3, 1.0}, {9, 0.1}}},
                                     {"late_ms", {{-3, 1.0}, {1, 0.1}}}}}}}}}};

bool matplotlib_is_installed() {
    return std::system("/usr/bin/python3 -c 'import matplotlib' 2>/dev/null") == 0;
}

TEST(Plot, WritesTheDocumentBesideThePicture) {
    const test::TemporaryFolder folder;
    const Status written = write_plot(folder / "loop.png", kDocument);
    ASSERT_TRUE(written) << written.error().text();
    std::ifstream file(folder / "loop.json");
    EXPECT_EQ(nlohmann::json::parse(file), kDocument);
    if (!matplotlib_is_installed()) GTEST_SKIP() << "python3-matplotlib is not installed";
    EXPECT_GT(std::filesystem::file_size(folder / "loop.png"), 5000u);
}

/// A request to stop that reaches a whole process group, as Ctrl-C does, must not cost the picture.
TEST(Plot, IsDrawnInAProcessGroupOfItsOwn) {
    const test::TemporaryFolder folder;
    const std::string program = folder / "plot";
    std::ofstream(program) << "#!/bin/sh\ncut -d' ' -f5 /proc/$$/stat > \"$3\"\n";
    std::filesystem::permissions(program, std::filesystem::perms::owner_all);
    const char* before = std::getenv("NARPA_PLOT");
    const std::string kept = before ? before : "";
    ::setenv("NARPA_PLOT", program.c_str(), 1);
    const Status written = write_plot(folder / "loop.png", kDocument);
    before ? ::setenv("NARPA_PLOT", kept.c_str(), 1) : ::unsetenv("NARPA_PLOT");
    ASSERT_TRUE(written) << written.error().text();
    pid_t group = 0;
    std::ifstream(folder / "loop.png") >> group;
    EXPECT_GT(group, 0);
    EXPECT_NE(group, ::getpgrp());
}

TEST(Plot, NumbersThatAreNotFiniteBecomeNull) {
    const test::TemporaryFolder folder;
    nlohmann::json document = kDocument;
    document["worst"] = NAN;
    ASSERT_TRUE(write_plot(folder / "loop.png", document));
    std::ifstream file(folder / "loop.json");
    EXPECT_TRUE(nlohmann::json::parse(file)["worst"].is_null());
}

TEST(Plot, ErrorNamesAPictureThatCannotBeWritten) {
    const test::TemporaryFolder folder;
    for (const std::string& path : {std::string("/nowhere/at/all.png"), folder / "loop.json"}) {
        for (const Status& status : {write_plot(path, kDocument), can_write_plot(path)}) {
            ASSERT_FALSE(status);
            EXPECT_EQ(status.error().file, std::filesystem::path(path).replace_extension(".json"));
        }
    }
    EXPECT_NE(write_plot("/nowhere/at/all.png", kDocument).error().what.find("No such file or directory"),
              std::string::npos);
    std::filesystem::create_symlink("/dev/full", folder / "full.json");
    const Status full = write_plot(folder / "full.png", kDocument);
    ASSERT_FALSE(full);
    EXPECT_NE(full.error().what.find("No space left on device"), std::string::npos) << full.error().text();
    EXPECT_TRUE(can_write_plot(folder / "loop.png"));
    if (!matplotlib_is_installed()) GTEST_SKIP() << "python3-matplotlib is not installed";
    EXPECT_FALSE(write_plot(folder / "loop.nothing", kDocument)) << "no picture format";
}

TEST(Plot, ImagesTravelWithinTheDocument) {
    const std::array<std::uint8_t, 6> pixels{'f', 'o', 'o', 'b', 'a', 'r'};
    EXPECT_EQ(plot_image(2, 1, 3, pixels),
              (nlohmann::json{{"width", 2}, {"height", 1}, {"channels", 3}, {"base64", "Zm9vYmFy"}}));
}

}  // namespace
}  // namespace narpa
