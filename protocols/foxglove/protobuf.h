/// protocols/foxglove/protobuf.h - Protobuf (proto3) messages and their descriptors, both from one table of fields.
///
/// A message is a struct with a ProtoSchema: its full name and its fields, in the order in which they are written.
/// The members' types decide on the types on the wire: double, float, std::int32_t, std::int64_t (varints),
/// std::uint32_t (fixed32), bool, std::string, ProtoBytes, an enum or a struct with a ProtoSchema; std::vector and
/// std::array are repeated fields, packed where they hold numbers. Zeros and empty texts are left out, as proto3
/// demands.
/// Source: protobuf.dev/programming-guides/encoding, and google/protobuf/descriptor.proto for the descriptors.
#pragma once

#include <array>
#include <bit>
#include <concepts>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <tuple>
#include <type_traits>
#include <vector>

#include "protocols/little_endian.h"

namespace narpa {

/// Specialised for each message: kName, "package.Name", and kFields, a tuple of ProtoField; and for each enum:
/// kName, kParent, the message that declares it, and kValues, the names of its values from 0 on.
template <class T>
struct ProtoSchema;

template <class Message, class Member>
struct ProtoField {
    int number;
    std::string_view name;
    Member Message::*member;
};
template <class Message, class Member>
ProtoField(int, std::string_view, Member Message::*) -> ProtoField<Message, Member>;

using ProtoBytes = std::span<const std::uint8_t>;

template <class T>
concept ProtoMessage = requires {
    ProtoSchema<T>::kFields;
};

/// Codes of FieldDescriptorProto.Type.
enum class ProtoType : std::int32_t {
    double_ = 1,
    float_ = 2,
    int64 = 3,
    uint64 = 4,
    int32 = 5,
    fixed32 = 7,
    bool_ = 8,
    string = 9,
    message = 11,
    bytes = 12,
    uint32 = 13,
    enum_ = 14,
};

// --- Values on the wire --------------------------------------------------

enum class ProtoWire : std::uint8_t { varint = 0, fixed64 = 1, delimited = 2, fixed32 = 5 };

inline void put_varint(std::vector<std::uint8_t>& out, std::uint64_t value) {
    for (; value >= 0x80; value >>= 7) out.push_back(static_cast<std::uint8_t>(value | 0x80));
    out.push_back(static_cast<std::uint8_t>(value));
}
inline void put_tag(std::vector<std::uint8_t>& out, int number, ProtoWire wire) {
    put_varint(out, static_cast<std::uint64_t>(number) << 3 | static_cast<std::uint64_t>(wire));
}
template <std::unsigned_integral T>
void append_le(std::vector<std::uint8_t>& out, T value) {
    out.resize(out.size() + sizeof(T));
    put_le(out.data() + out.size() - sizeof(T), value);
}
/// Bytes with their tag and length.
inline void put_delimited(std::vector<std::uint8_t>& out, int number, ProtoBytes bytes) {
    put_tag(out, number, ProtoWire::delimited);
    put_varint(out, bytes.size());
    out.insert(out.end(), bytes.begin(), bytes.end());
}
/// What `put_content` appends, with tag and length.
void put_nested(std::vector<std::uint8_t>& out, int number, const auto& put_content) {
    put_tag(out, number, ProtoWire::delimited);
    const std::size_t begin = out.size();
    put_content();
    std::vector<std::uint8_t> length;
    put_varint(length, out.size() - begin);
    out.insert(out.begin() + static_cast<std::ptrdiff_t>(begin), length.begin(), length.end());
}

/// How a number is written, without its tag.
template <class T>
struct ProtoNumber;
template <class T, ProtoType kOf>
struct ProtoVarint {
    static constexpr ProtoType kType = kOf;
    static constexpr ProtoWire kWire = ProtoWire::varint;
    /// Negative numbers are extended to 64 bits.
    static void put(std::vector<std::uint8_t>& out, T value) {
        if constexpr (std::is_enum_v<T>)
            put_varint(out, static_cast<std::uint64_t>(value));
        else
            put_varint(out, static_cast<std::uint64_t>(static_cast<std::int64_t>(value)));
    }
};
template <>
struct ProtoNumber<std::int32_t> : ProtoVarint<std::int32_t, ProtoType::int32> {};
template <>
struct ProtoNumber<std::int64_t> : ProtoVarint<std::int64_t, ProtoType::int64> {};
template <>
struct ProtoNumber<bool> : ProtoVarint<bool, ProtoType::bool_> {};
template <class T>
requires std::is_enum_v<T>
struct ProtoNumber<T> : ProtoVarint<T, ProtoType::enum_> {
};
template <>
struct ProtoNumber<std::uint32_t> {
    static constexpr ProtoType kType = ProtoType::fixed32;
    static constexpr ProtoWire kWire = ProtoWire::fixed32;
    static void put(std::vector<std::uint8_t>& out, std::uint32_t value) { append_le(out, value); }
};
template <>
struct ProtoNumber<double> {
    static constexpr ProtoType kType = ProtoType::double_;
    static constexpr ProtoWire kWire = ProtoWire::fixed64;
    static void put(std::vector<std::uint8_t>& out, double value) {
        append_le(out, std::bit_cast<std::uint64_t>(value));
    }
};
template <>
struct ProtoNumber<float> {
    static constexpr ProtoType kType = ProtoType::float_;
    static constexpr ProtoWire kWire = ProtoWire::fixed32;
    static void put(std::vector<std::uint8_t>& out, float value) {
        append_le(out, std::bit_cast<std::uint32_t>(value));
    }
};

// --- Messages ----------------------------------------------------------

template <class T>
struct ProtoItem {  ///< of a repeated field; void: not repeated
    using type = void;
};
template <class T>
struct ProtoItem<std::vector<T>> {
    using type = T;
};
template <class T, std::size_t n>
struct ProtoItem<std::array<T, n>> {
    using type = T;
};

template <ProtoMessage Message>
void encode_proto(const Message& message, std::vector<std::uint8_t>& out);

template <class T>
void put_field(std::vector<std::uint8_t>& out, int number, const T& value) {
    using Item = typename ProtoItem<T>::type;
    if constexpr (ProtoMessage<T>) {
        put_nested(out, number, [&] { encode_proto(value, out); });
    } else if constexpr (std::is_same_v<T, std::string>) {
        if (!value.empty())
            put_delimited(out, number, {reinterpret_cast<const std::uint8_t*>(value.data()), value.size()});
    } else if constexpr (std::is_same_v<T, ProtoBytes>) {
        if (!value.empty()) put_delimited(out, number, value);
    } else if constexpr (std::is_void_v<Item>) {
        if (value == T{}) return;
        put_tag(out, number, ProtoNumber<T>::kWire);
        ProtoNumber<T>::put(out, value);
    } else if constexpr (ProtoMessage<Item>) {
        for (const Item& item : value) put_field(out, number, item);
    } else if constexpr (std::is_same_v<Item, std::string>) {
        for (const Item& item : value)
            put_delimited(out, number, {reinterpret_cast<const std::uint8_t*>(item.data()), item.size()});
    } else {
        if (value.empty()) return;
        put_nested(out, number, [&] {
            for (const Item& item : value) ProtoNumber<Item>::put(out, item);
        });
    }
}
template <ProtoMessage T>
void put_field(std::vector<std::uint8_t>& out, int number, const std::optional<T>& value) {
    if (value) put_field(out, number, *value);
}

/// Appends the message.
template <ProtoMessage Message>
void encode_proto(const Message& message, std::vector<std::uint8_t>& out) {
    std::apply([&](const auto&... field) { (put_field(out, field.number, message.*(field.member)), ...); },
               ProtoSchema<Message>::kFields);
}

}  // namespace narpa
