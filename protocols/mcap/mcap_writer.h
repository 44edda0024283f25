/// protocols/mcap/mcap_writer.h - the bytes of an MCAP file: compressed chunks of messages with indexes, a summary,
/// and checksums. No files: the bytes go where the caller wants them.
/// Source: mcap.dev/spec, version 0. A record is its opcode (1 byte), the length of its content (8) and the
/// content; all integers are little-endian, texts and arrays have their length in bytes (4) before them.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace narpa {

struct McapOptions {
    std::size_t chunk_bytes = 4 << 20;  ///< of messages before compression, about
    /// Replaces `to` by a zstd frame of `from`; empty: chunks are not compressed. So that this folder needs no
    /// library.
    std::function<void(std::span<const std::uint8_t> from, std::vector<std::uint8_t>& to)> zstd{};
    std::string library = "narpa";  ///< who wrote the file
};

class McapWriter {
public:
    using Bytes = std::span<const std::uint8_t>;

    /// `write` takes the bytes of the file, one piece after the other, beginning here with its magic and header.
    McapWriter(std::function<void(Bytes)> write, const McapOptions& options = {});
    ~McapWriter();
    McapWriter(const McapWriter&) = delete;
    McapWriter& operator=(const McapWriter&) = delete;

    // Before the first message.

    void add_metadata(const std::string& name, const std::map<std::string, std::string>& values);
    /// A schema in the encoding "protobuf". `descriptors`: a FileDescriptorSet. Returns its number.
    std::uint16_t add_schema(std::string_view name, Bytes descriptors);
    /// A channel of messages in the encoding "protobuf". Returns its number.
    std::uint16_t add_channel(std::string_view topic, std::uint16_t schema);

    /// Times: ns, not negative; a reader orders the messages by `log_ns`.
    void add_message(std::uint16_t channel, std::int64_t log_ns, std::int64_t publish_ns, Bytes data);
    /// Writes the last chunk and the summary. Nothing may be added after it.
    void finish();

    [[nodiscard]] std::uint64_t messages() const noexcept { return messages_; }
    [[nodiscard]] std::uint64_t bytes() const noexcept { return position_; }  ///< written so far

private:
    struct Entry {
        std::uint64_t log_ns, offset;  ///< in the chunk, uncompressed
    };
    struct Channel {
        std::uint64_t messages = 0;
        std::vector<Entry> in_chunk;
    };
    struct TimeSpan {
        std::uint64_t first_ns = UINT64_MAX, last_ns = 0;
        void add(std::uint64_t t_ns) noexcept;
    };

    void write(Bytes bytes);
    void end_chunk();
    void write_summary();

    std::function<void(Bytes)> write_;
    McapOptions options_;
    std::uint64_t position_ = 0, messages_ = 0;
    std::uint32_t crc_ = 0;  ///< of all bytes since the last time it was 0
    std::uint32_t schemas_ = 0, metadata_ = 0, chunks_ = 0;
    std::vector<Channel> channels_;  ///< number 1 is the first
    TimeSpan times_, chunk_times_;
    std::vector<std::uint8_t> chunk_, compressed_, record_;
    // Records of the summary.
    std::vector<std::uint8_t> schema_records_, channel_records_, chunk_indexes_, metadata_indexes_;
};

}  // namespace narpa
