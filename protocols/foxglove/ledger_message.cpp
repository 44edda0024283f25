#include "protocols/foxglove/ledger_message.h"

#include "protocols/foxglove/descriptors.h"
#include "protocols/ledger_fields.h"

namespace narpa {
namespace {

constexpr std::string_view kCrcName = "image_crc32";

/// A named value is written as a text.
template <class T>
constexpr ProtoType ledger_type(const LedgerField& field) {
    if (!field.signal.choices.empty()) return ProtoType::string;
    if (std::is_same_v<T, bool>) return ProtoType::bool_;
    if (std::is_same_v<T, float>) return ProtoType::float_;
    if (std::is_same_v<T, std::int64_t>) return ProtoType::int64;
    if (std::is_same_v<T, std::uint64_t>) return ProtoType::uint64;
    if (std::is_same_v<T, std::int16_t>) return ProtoType::int32;
    return ProtoType::uint32;
}

template <class T>
void put_ledger_value(std::vector<std::uint8_t>& out, int number, const LedgerField& field, const T& value) {
    if constexpr (std::is_same_v<T, FrameLedger::Passes>) {
        put_nested(out, number, [&] {
            for (std::size_t i = 0; i < value.size() && value[i] > 0; ++i) put_varint(out, value[i]);
        });
    } else if (!field.signal.choices.empty()) {
        put_field(out, number, std::string(field.signal.choices[static_cast<std::size_t>(value)].name));
    } else if constexpr (std::is_same_v<T, float> || std::is_same_v<T, bool>) {
        put_field(out, number, value);
    } else if constexpr (!std::is_enum_v<T>) {
        if (value == 0) return;
        put_tag(out, number, ProtoWire::varint);
        put_varint(out, static_cast<std::uint64_t>(static_cast<std::int64_t>(value)));
    }
}

}  // namespace

void encode_ledger_message(const FrameLedger& ledger, std::uint32_t image_crc32, std::vector<std::uint8_t>& out) {
    int number = 0;
    for (const LedgerField& field : kLedgerColumns) {
        ++number;
        visit_field(field, ledger, [&](const auto& value) { put_ledger_value(out, number, field, value); });
    }
    put_field(out, number + 1, image_crc32);
}

std::vector<std::uint8_t> ledger_message_descriptors() {
    ProtoFileDescriptor file = empty_proto_file(kLedgerMessage);
    auto& fields = file.messages[0].fields;
    FrameLedger ledger;
    for (const LedgerField& field : kLedgerColumns)
        visit_field(field, ledger, [&]<class T>(const T&) {
            fields.push_back({std::string(field.name), static_cast<std::int32_t>(fields.size() + 1),
                              std::is_same_v<T, FrameLedger::Passes> ? 3 : 1,
                              static_cast<std::int32_t>(ledger_type<T>(field)), ""});
        });
    fields.push_back({std::string(kCrcName), static_cast<std::int32_t>(fields.size() + 1), 1,
                      static_cast<std::int32_t>(ProtoType::fixed32), ""});
    std::vector<std::uint8_t> bytes;
    encode_proto(ProtoFileSet{{file}}, bytes);
    return bytes;
}

}  // namespace narpa
