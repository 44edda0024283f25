/// tests/protocols/protobuf_reader.h - the fields of a Protobuf message as they are on the wire, without a schema.
#pragma once

#include <gtest/gtest.h>

#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "protocols/little_endian.h"

namespace narpa::test {

struct ProtoValueRead {
    std::uint64_t number = 0;           ///< of a varint, fixed32 or fixed64
    std::vector<std::uint8_t> bytes{};  ///< of a text, bytes or a message
};
using ProtoFields = std::multimap<int, ProtoValueRead>;

inline std::uint64_t read_varint(std::span<const std::uint8_t>& in) {
    std::uint64_t value = 0;
    for (int shift = 0; !in.empty(); shift += 7) {
        const std::uint8_t byte = in.front();
        in = in.subspan(1);
        value |= static_cast<std::uint64_t>(byte & 0x7F) << shift;
        if (byte < 0x80) return value;
    }
    ADD_FAILURE() << "a varint has no end";
    return value;
}

inline ProtoFields read_proto(std::span<const std::uint8_t> in) {
    ProtoFields fields;
    while (!in.empty()) {
        const std::uint64_t tag = read_varint(in);
        ProtoValueRead value;
        std::size_t size = 0;
        switch (tag & 7) {
            case 0: value.number = read_varint(in); break;
            case 1: size = 8; break;
            case 2: size = read_varint(in); break;
            case 5: size = 4; break;
            default: ADD_FAILURE() << "wire type " << (tag & 7); return fields;
        }
        if (size > in.size()) {
            ADD_FAILURE() << "field " << (tag >> 3) << " is longer than the message";
            return fields;
        }
        if ((tag & 7) == 1) value.number = get_le<std::uint64_t>(in.data());
        if ((tag & 7) == 5) value.number = get_le<std::uint32_t>(in.data());
        if ((tag & 7) == 2) value.bytes.assign(in.begin(), in.begin() + static_cast<std::ptrdiff_t>(size));
        in = in.subspan(size);
        fields.emplace(static_cast<int>(tag >> 3), std::move(value));
    }
    return fields;
}

inline std::string text_of(const ProtoValueRead& value) {
    return {value.bytes.begin(), value.bytes.end()};
}

}  // namespace narpa::test
