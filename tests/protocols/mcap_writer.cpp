// The container of MCAP: by hand where it is short, and read back record by record and by its index.
#include "protocols/mcap/mcap_writer.h"

#include <gtest/gtest.h>

#include "tests/protocols/mcap_reader.h"

namespace narpa::test {
namespace {

using FileBytes = std::vector<std::uint8_t>;

/// Collects what a writer writes.
struct Written {
    FileBytes bytes;
    auto sink() {
        return [this](McapWriter::Bytes piece) { bytes.insert(bytes.end(), piece.begin(), piece.end()); };
    }
};

void zstd(std::span<const std::uint8_t> from, FileBytes& to) {
    to.resize(ZSTD_compressBound(from.size()));
    to.resize(ZSTD_compress(to.data(), to.size(), from.data(), from.size(), 1));
}

TEST(McapWriter, AnEmptyFileHasMagicHeaderEndStatisticsAndFooter) {
    Written file;
    McapWriter writer(file.sink(), {.library = "x"});
    writer.finish();
    const FileBytes begin{0x89, 'M', 'C', 'A', 'P', '0', '\r', '\n',     // magic
                          0x01, 9,   0,   0,   0,   0,   0,    0,    0,  // header of 4 + 0 + 4 + 1 bytes
                          0,    0,   0,   0,   1,   0,   0,    0,    'x',
                          0x0F, 4};  // no profile; library; the data's end
    ASSERT_GT(file.bytes.size(), begin.size());
    EXPECT_EQ(FileBytes(file.bytes.begin(), file.bytes.begin() + static_cast<std::ptrdiff_t>(begin.size())), begin);
    EXPECT_EQ(file.bytes.size(), writer.bytes());
}

TEST(McapWriter, WhatIsWrittenIsReadBackAsAStreamAndByIndex) {
    for (const bool compresses : {false, true}) {
        Written file;
        McapWriter writer(file.sink(), {.chunk_bytes = 1000, .zstd = compresses ? zstd : nullptr});
        writer.add_metadata("run", {{"scene", "docking"}, {"seed", "7"}});
        const FileBytes schema{1, 2, 3};
        const auto a = writer.add_channel("/a", writer.add_schema("p.A", schema));
        const auto b = writer.add_channel("/b", writer.add_schema("p.B", FileBytes{}));
        for (std::uint8_t k = 0; k < 100; ++k) {
            writer.add_message(a, 1000 - k, 2000 + k, FileBytes(k, k));  // from the newest to the oldest
            if (k % 10 == 0) writer.add_message(b, k, k, FileBytes{k});
        }
        writer.finish();
        const McapFileRead read = read_mcap(file.bytes);
        EXPECT_EQ(read.metadata, (std::map<std::string, std::string>{{"scene", "docking"}, {"seed", "7"}}));
        EXPECT_EQ(read.schemas.at("p.A"), schema);
        ASSERT_EQ(read.messages.size(), 110U);
        EXPECT_EQ(read.indexed, 110U);
        EXPECT_EQ(read.counted, 110U);
        EXPECT_EQ(writer.messages(), 110U);
        EXPECT_GT(read.chunks, 5U);
        EXPECT_EQ(read.count("/b"), 10U);
        const McapMessageRead& last = read.messages.back();
        EXPECT_EQ(last.topic, "/a");
        EXPECT_EQ(last.schema, "p.A");
        EXPECT_EQ(last.sequence, 99U);
        EXPECT_EQ(last.log_ns, 901U);
        EXPECT_EQ(last.publish_ns, 2099U);
        EXPECT_EQ(last.data, FileBytes(99, 99));
    }
}

TEST(McapWriter, ATimeBeforeZeroIsZero) {
    Written file;
    McapWriter writer(file.sink());
    const auto channel = writer.add_channel("/a", writer.add_schema("p.A", FileBytes{}));
    writer.add_message(channel, -5, -1, FileBytes{1});
    writer.finish();
    const McapFileRead read = read_mcap(file.bytes);
    ASSERT_EQ(read.messages.size(), 1U);
    EXPECT_EQ(read.messages[0].log_ns, 0U);
}

TEST(McapWriter, TheSameMessagesGiveTheSameBytes) {
    const auto make = [] {
        Written file;
        McapWriter writer(file.sink());
        const auto channel = writer.add_channel("/a", writer.add_schema("p.A", FileBytes{}));
        for (int k = 0; k < 50; ++k)
            writer.add_message(channel, k, k, FileBytes(1000, static_cast<std::uint8_t>(k)));
        writer.finish();
        return file.bytes;
    };
    EXPECT_EQ(make(), make());
}

}  // namespace
}  // namespace narpa::test
