#include "protocols/mcap/mcap_writer.h"

#include <algorithm>
#include <array>
#include <cassert>

#include "protocols/crc32.h"
#include "protocols/little_endian.h"

namespace narpa {
namespace {

constexpr std::array<std::uint8_t, 8> kMcapMagic{0x89, 'M', 'C', 'A', 'P', '0', '\r', '\n'};

enum class McapOpcode : std::uint8_t {
    header = 0x01,
    footer = 0x02,
    schema = 0x03,
    channel = 0x04,
    message = 0x05,
    chunk = 0x06,
    message_index = 0x07,
    chunk_index = 0x08,
    statistics = 0x0B,
    metadata = 0x0C,
    metadata_index = 0x0D,
    summary_offset = 0x0E,
    data_end = 0x0F,
};

/// Appends one record; its length is known when the object goes.
class McapRecord {
public:
    McapRecord(std::vector<std::uint8_t>& out, McapOpcode opcode) : out_(out) {
        out_.push_back(static_cast<std::uint8_t>(opcode));
        begin_ = begin_array<std::uint64_t>();
    }
    McapRecord(const McapRecord&) = delete;
    McapRecord& operator=(const McapRecord&) = delete;
    ~McapRecord() { end_array<std::uint64_t>(begin_); }

    template <std::unsigned_integral T>
    void put(T value) {
        out_.resize(out_.size() + sizeof(T));
        put_le(out_.data() + out_.size() - sizeof(T), value);
    }
    void put(std::string_view text) {
        put(static_cast<std::uint32_t>(text.size()));
        out_.insert(out_.end(), text.begin(), text.end());
    }
    void put_raw(McapWriter::Bytes bytes) { out_.insert(out_.end(), bytes.begin(), bytes.end()); }
    /// An array whose length is a T; its place is to be given to end_array.
    template <class T = std::uint32_t>
    std::size_t begin_array() {
        put(T{0});
        return out_.size();
    }
    template <class T = std::uint32_t>
    void end_array(std::size_t begin) {
        put_le(out_.data() + begin - sizeof(T), static_cast<T>(out_.size() - begin));
    }

private:
    std::vector<std::uint8_t>& out_;
    std::size_t begin_ = 0;
};

std::uint64_t mcap_time(std::int64_t t_ns) noexcept {
    return static_cast<std::uint64_t>(std::max<std::int64_t>(0, t_ns));
}

}  // namespace

void McapWriter::TimeSpan::add(std::uint64_t t_ns) noexcept {
    first_ns = std::min(first_ns, t_ns);
    last_ns = std::max(last_ns, t_ns);
}

McapWriter::McapWriter(std::function<void(Bytes)> write, const McapOptions& options)
    : write_(std::move(write)), options_(options) {
    {
        McapRecord record(record_, McapOpcode::header);
        record.put("");  // profile
        record.put(options_.library);
    }
    this->write(kMcapMagic);
    this->write(record_);
}

McapWriter::~McapWriter() = default;

void McapWriter::write(Bytes bytes) {
    crc_ = crc32(bytes, crc_);
    position_ += bytes.size();
    write_(bytes);
}

void McapWriter::add_metadata(const std::string& name, const std::map<std::string, std::string>& values) {
    record_.clear();
    {
        McapRecord record(record_, McapOpcode::metadata);
        record.put(name);
        const std::size_t array = record.begin_array();
        for (const auto& [key, value] : values) record.put(key), record.put(value);
        record.end_array(array);
    }
    McapRecord index(metadata_indexes_, McapOpcode::metadata_index);
    index.put(position_);
    index.put(std::uint64_t{record_.size()});
    index.put(name);
    ++metadata_;
    write(record_);
}

std::uint16_t McapWriter::add_schema(std::string_view name, Bytes descriptors) {
    record_.clear();
    const auto id = static_cast<std::uint16_t>(++schemas_);
    {
        McapRecord record(record_, McapOpcode::schema);
        record.put(id);
        record.put(name);
        record.put("protobuf");
        record.put(static_cast<std::uint32_t>(descriptors.size()));
        record.put_raw(descriptors);
    }
    schema_records_.insert(schema_records_.end(), record_.begin(), record_.end());
    write(record_);
    return id;
}

std::uint16_t McapWriter::add_channel(std::string_view topic, std::uint16_t schema) {
    assert(messages_ == 0 && "channels are written before the chunks");
    record_.clear();
    channels_.emplace_back();
    const auto id = static_cast<std::uint16_t>(channels_.size());
    {
        McapRecord record(record_, McapOpcode::channel);
        record.put(id);
        record.put(schema);
        record.put(topic);
        record.put("protobuf");
        record.put(std::uint32_t{0});  // metadata
    }
    channel_records_.insert(channel_records_.end(), record_.begin(), record_.end());
    write(record_);
    return id;
}

void McapWriter::add_message(std::uint16_t channel, std::int64_t log_ns, std::int64_t publish_ns, Bytes data) {
    assert(channel >= 1 && channel <= channels_.size());
    Channel& c = channels_[channel - 1];
    const std::uint64_t t_ns = mcap_time(log_ns);
    c.in_chunk.push_back({t_ns, chunk_.size()});
    {
        McapRecord record(chunk_, McapOpcode::message);
        record.put(channel);
        record.put(static_cast<std::uint32_t>(c.messages));  // sequence
        record.put(t_ns);
        record.put(mcap_time(publish_ns));
        record.put_raw(data);
    }
    ++c.messages;
    ++messages_;
    times_.add(t_ns);
    chunk_times_.add(t_ns);
    if (chunk_.size() >= options_.chunk_bytes) end_chunk();
}

void McapWriter::end_chunk() {
    if (chunk_.empty()) return;
    Bytes content = chunk_;
    std::string_view compression;
    if (options_.zstd) {
        options_.zstd(chunk_, compressed_);
        content = compressed_;
        compression = "zstd";
    }
    record_.clear();
    {
        McapRecord record(record_, McapOpcode::chunk);
        record.put(chunk_times_.first_ns);
        record.put(chunk_times_.last_ns);
        record.put(std::uint64_t{chunk_.size()});
        record.put(crc32(chunk_));
        record.put(compression);
        record.put(std::uint64_t{content.size()});
        record.put_raw(content);
    }
    const std::uint64_t chunk_at = position_, chunk_bytes = record_.size();
    write(record_);

    record_.clear();
    std::vector<std::pair<std::uint16_t, std::uint64_t>> offsets;
    for (std::size_t i = 0; i < channels_.size(); ++i) {
        std::vector<Entry>& entries = channels_[i].in_chunk;
        if (entries.empty()) continue;
        std::ranges::stable_sort(entries, {}, &Entry::log_ns);
        offsets.emplace_back(i + 1, position_ + record_.size());
        McapRecord record(record_, McapOpcode::message_index);
        record.put(static_cast<std::uint16_t>(i + 1));
        const std::size_t array = record.begin_array();
        for (const Entry& e : entries) record.put(e.log_ns), record.put(e.offset);
        record.end_array(array);
        entries.clear();
    }
    McapRecord index(chunk_indexes_, McapOpcode::chunk_index);
    index.put(chunk_times_.first_ns);
    index.put(chunk_times_.last_ns);
    index.put(chunk_at);
    index.put(chunk_bytes);
    const std::size_t map = index.begin_array();
    for (const auto& [channel, offset] : offsets) index.put(channel), index.put(offset);
    index.end_array(map);
    index.put(std::uint64_t{record_.size()});
    index.put(compression);
    index.put(std::uint64_t{content.size()});
    index.put(std::uint64_t{chunk_.size()});
    write(record_);
    ++chunks_;
    chunk_.clear();
    chunk_times_ = {};
}

void McapWriter::finish() {
    end_chunk();
    record_.clear();
    {
        McapRecord record(record_, McapOpcode::data_end);
        record.put(crc_);
    }
    write(record_);
    crc_ = 0;
    write_summary();
}

void McapWriter::write_summary() {
    const std::uint64_t summary_at = position_;
    std::vector<std::uint8_t> statistics, offsets;
    {
        McapRecord record(statistics, McapOpcode::statistics);
        record.put(messages_);
        record.put(static_cast<std::uint16_t>(schemas_));
        record.put(static_cast<std::uint32_t>(channels_.size()));
        record.put(std::uint32_t{0});  // attachments
        record.put(metadata_);
        record.put(chunks_);
        record.put(messages_ > 0 ? times_.first_ns : 0);
        record.put(times_.last_ns);
        const std::size_t counts = record.begin_array();
        for (std::size_t i = 0; i < channels_.size(); ++i)
            record.put(static_cast<std::uint16_t>(i + 1)), record.put(channels_[i].messages);
        record.end_array(counts);
    }
    for (const auto& [opcode, group] : {std::pair{McapOpcode::schema, &schema_records_},
                                        {McapOpcode::channel, &channel_records_},
                                        {McapOpcode::statistics, &statistics},
                                        {McapOpcode::chunk_index, &chunk_indexes_},
                                        {McapOpcode::metadata_index, &metadata_indexes_}}) {
        if (group->empty()) continue;
        McapRecord record(offsets, McapOpcode::summary_offset);
        record.put(static_cast<std::uint8_t>(opcode));
        record.put(position_);
        record.put(std::uint64_t{group->size()});
        write(*group);
    }
    const std::uint64_t offsets_at = position_;
    write(offsets);
    record_.clear();
    std::size_t crc_at = 0;
    {
        McapRecord record(record_, McapOpcode::footer);
        record.put(summary_at);
        record.put(offsets_at);
        crc_at = record_.size();
        record.put(std::uint32_t{0});
    }
    // The checksum is of the summary and of the footer up to itself.
    put_le(record_.data() + crc_at, crc32(Bytes(record_).first(crc_at), crc_));
    write(record_);
    write(kMcapMagic);
}

}  // namespace narpa
