/// tests/protocols/mcap_reader.h - reads an MCAP file twice, record by record and by its index, and checks lengths,
/// offsets and checksums on the way.
#pragma once

#include <gtest/gtest.h>
#include <zlib.h>
#include <zstd.h>

#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "protocols/little_endian.h"

namespace narpa::test {

struct McapMessageRead {
    std::string topic, schema;
    std::uint32_t sequence = 0;
    std::uint64_t log_ns = 0, publish_ns = 0;
    std::vector<std::uint8_t> data;
};
struct McapFileRead {
    std::map<std::string, std::string> metadata;
    std::map<std::string, std::vector<std::uint8_t>> schemas;
    std::vector<McapMessageRead> messages;  ///< in the order of the file
    std::size_t chunks = 0, indexed = 0;    ///< messages that the indexes of the chunks lead to
    std::uint64_t counted = 0;              ///< messages by the statistics
    std::vector<std::uint8_t> opcodes;

    [[nodiscard]] std::size_t count(const std::string& topic) const {
        std::size_t n = 0;
        for (const McapMessageRead& m : messages) n += m.topic == topic ? 1 : 0;
        return n;
    }
};

/// Takes values from the front of bytes.
struct McapCursor {
    std::span<const std::uint8_t> in;

    std::span<const std::uint8_t> take(std::size_t n) {
        if (n > in.size()) {
            ADD_FAILURE() << n << " bytes wanted, " << in.size() << " left";
            n = in.size();
        }
        const auto taken = in.first(n);
        in = in.subspan(n);
        return taken;
    }
    template <class T>
    T number() {
        const auto bytes = take(sizeof(T));
        return bytes.size() == sizeof(T) ? get_le<T>(bytes.data()) : T{0};
    }
    std::string text() {
        const auto bytes = take(number<std::uint32_t>());
        return {bytes.begin(), bytes.end()};
    }
};

class McapRead {
public:
    explicit McapRead(std::span<const std::uint8_t> file) : all_(file) {
        constexpr std::size_t kMagic = 8;
        const std::string magic = "\x89MCAP0\r\n";
        EXPECT_EQ(std::string(file.begin(), file.begin() + kMagic), magic);
        EXPECT_EQ(std::string(file.end() - kMagic, file.end()), magic);
        records(file.subspan(kMagic, file.size() - 2 * kMagic), kMagic, true);
    }
    McapFileRead out;

private:
    static std::uint32_t crc(std::span<const std::uint8_t> bytes) {
        return static_cast<std::uint32_t>(::crc32_z(0, bytes.data(), bytes.size()));
    }

    void records(std::span<const std::uint8_t> bytes, std::size_t offset, bool top) {
        McapCursor c{bytes};
        while (!c.in.empty()) {
            const std::size_t at = offset + bytes.size() - c.in.size();
            const auto opcode = c.number<std::uint8_t>();
            McapCursor content{c.take(c.number<std::uint64_t>())};
            if (top) out.opcodes.push_back(opcode);
            record(opcode, content, at, at + 9 + content.in.size());
        }
    }

    void record(std::uint8_t opcode, McapCursor c, std::size_t at, std::size_t end) {
        const auto whole = all_.subspan(0, end);
        if (opcode == 0x03) {
            const auto id = c.number<std::uint16_t>();
            const std::string name = c.text();
            EXPECT_EQ(c.text(), "protobuf");
            const auto data = c.take(c.number<std::uint32_t>());
            out.schemas[name] = {data.begin(), data.end()};
            schema_names_[id] = name;
        } else if (opcode == 0x04) {
            const auto id = c.number<std::uint16_t>(), schema = c.number<std::uint16_t>();
            channels_[id] = {c.text(), schema_names_.at(schema)};
            EXPECT_EQ(c.text(), "protobuf");
        } else if (opcode == 0x05) {
            McapMessageRead m;
            const auto channel = c.number<std::uint16_t>();
            m.topic = channels_.at(channel).first;
            m.schema = channels_.at(channel).second;
            m.sequence = c.number<std::uint32_t>();
            m.log_ns = c.number<std::uint64_t>();
            m.publish_ns = c.number<std::uint64_t>();
            m.data.assign(c.in.begin(), c.in.end());
            out.messages.push_back(std::move(m));
        } else if (opcode == 0x06) {
            chunk(c, at);
        } else if (opcode == 0x08) {
            chunk_index(c);
        } else if (opcode == 0x0B) {
            out.counted = c.number<std::uint64_t>();
        } else if (opcode == 0x0C) {
            c.text();
            McapCursor map{c.take(c.number<std::uint32_t>())};
            while (!map.in.empty()) {
                const std::string key = map.text();
                out.metadata[key] = map.text();
            }
        } else if (opcode == 0x0E) {
            const auto grouped = c.number<std::uint8_t>();
            EXPECT_EQ(grouped, all_[c.number<std::uint64_t>()]) << "a group of the summary";
        } else if (opcode == 0x0F) {
            EXPECT_EQ(c.number<std::uint32_t>(), crc(whole.first(at))) << "of the data section";
        } else if (opcode == 0x02) {
            const auto summary = c.number<std::uint64_t>(), offsets = c.number<std::uint64_t>();
            EXPECT_EQ(all_[summary], 0x03) << "the summary begins with schemas";
            EXPECT_EQ(all_[offsets], 0x0E);
            EXPECT_EQ(c.number<std::uint32_t>(), crc(all_.subspan(summary, end - 4 - summary)));
        }
    }

    void chunk(McapCursor c, std::size_t at) {
        const auto first = c.number<std::uint64_t>(), last = c.number<std::uint64_t>();
        const auto size = c.number<std::uint64_t>();
        const auto sum = c.number<std::uint32_t>();
        const std::string compression = c.text();
        const auto content = c.take(c.number<std::uint64_t>());
        std::vector<std::uint8_t> bytes(size);
        if (compression == "zstd")
            EXPECT_EQ(ZSTD_decompress(bytes.data(), size, content.data(), content.size()), size);
        else
            bytes.assign(content.begin(), content.end());
        EXPECT_EQ(crc(bytes), sum);
        const std::size_t before = out.messages.size();
        records(bytes, 0, false);
        for (std::size_t i = before; i < out.messages.size(); ++i) {
            EXPECT_GE(out.messages[i].log_ns, first);
            EXPECT_LE(out.messages[i].log_ns, last);
        }
        ++out.chunks;
        unpacked_[at] = std::move(bytes);
    }

    void chunk_index(McapCursor c) {
        const auto first = c.number<std::uint64_t>(), last = c.number<std::uint64_t>(),
                   at = c.number<std::uint64_t>();
        const auto length = c.number<std::uint64_t>();
        ASSERT_EQ(unpacked_.count(at), 1U);
        EXPECT_EQ(get_le<std::uint64_t>(all_.data() + at + 1) + 9, length);
        EXPECT_LE(first, last);
        McapCursor map{c.take(c.number<std::uint32_t>())};
        while (!map.in.empty()) {
            const auto channel = map.number<std::uint16_t>();
            const auto offset = map.number<std::uint64_t>();
            McapCursor index{all_.subspan(offset)};
            EXPECT_EQ(index.number<std::uint8_t>(), 0x07);
            McapCursor content{index.take(index.number<std::uint64_t>())};
            EXPECT_EQ(content.number<std::uint16_t>(), channel);
            McapCursor entries{content.take(content.number<std::uint32_t>())};
            std::uint64_t newest = 0;
            while (!entries.in.empty()) {
                const auto t = entries.number<std::uint64_t>();
                McapCursor message{
                    std::span<const std::uint8_t>(unpacked_[at]).subspan(entries.number<std::uint64_t>())};
                EXPECT_EQ(message.number<std::uint8_t>(), 0x05);
                message.number<std::uint64_t>();
                EXPECT_EQ(message.number<std::uint16_t>(), channel);
                message.number<std::uint32_t>();
                EXPECT_EQ(message.number<std::uint64_t>(), t);
                EXPECT_GE(t, newest) << "an index is in the order of time";
                newest = t;
                ++out.indexed;
            }
        }
    }

    std::span<const std::uint8_t> all_;
    std::map<std::uint16_t, std::string> schema_names_;
    std::map<std::uint16_t, std::pair<std::string, std::string>> channels_;
    std::map<std::uint64_t, std::vector<std::uint8_t>> unpacked_;  ///< chunks by their offsets
};

[[nodiscard]] inline McapFileRead read_mcap(std::span<const std::uint8_t> file) {
    return McapRead(file).out;
}

}  // namespace narpa::test
