// What a log's file holds while the run goes on.
#include "emulator/log/row_log.h"

#include <gtest/gtest.h>

#include <chrono>
#include <string>
#include <thread>

#include "tests/support/read_file.h"
#include "tests/support/temporary_folder.h"

namespace narpa {
namespace {

TEST(RowLog, RowsReachTheFileWithoutAnEnd) {
    const test::TemporaryFolder folder;
    const std::string path = folder / "rows.csv";
    const auto log = RowLog::create(path, "row\n", true);
    ASSERT_TRUE(log);
    EXPECT_EQ(test::read_text(path), "row\n");
    (*log)->append("1\n");
    for (int i = 0; i < 6000 && test::read_text(path) != "row\n1\n"; ++i)
        std::this_thread::sleep_for(std::chrono::milliseconds(10));
    EXPECT_EQ(test::read_text(path), "row\n1\n");
}

TEST(RowLog, AFileEndsWithAWholeRowAtAnyTime) {
    const test::TemporaryFolder folder;
    const std::string path = folder / "rows.csv", row = std::string(100, '7') + "\n";
    const auto log = RowLog::create(path, row, true);
    ASSERT_TRUE(log);
    std::size_t cut = 0;
    for (int i = 0; i < 20'000; ++i) {
        (*log)->append(row);
        if (i % 100 == 0) cut += test::read_text(path).size() % row.size() != 0;
    }
    EXPECT_EQ(cut, 0U);
    ASSERT_TRUE((*log)->close());
    EXPECT_EQ(test::read_text(path).size(), 20'001 * row.size());
}

}  // namespace
}  // namespace narpa
