/// protocols/foxglove/descriptors.h - the FileDescriptorSet of a message: what MCAP and Foxglove's WebSocket take
/// as the schema of the encoding "protobuf". Made from the tables that encode the messages. Source:
/// google/protobuf/descriptor.proto.
#pragma once

#include <algorithm>
#include <cctype>
#include <string>
#include <vector>

#include "protocols/foxglove/protobuf.h"

namespace narpa {

struct ProtoFieldDescriptor {
    std::string name;
    std::int32_t number = 0;
    std::int32_t label = 1;   ///< 1 optional, 3 repeated
    std::int32_t type = 0;    ///< ProtoType
    std::string type_name{};  ///< ".package.Name" of a message or an enum
};
struct ProtoEnumValueDescriptor {
    std::string name;
    std::int32_t number = 0;
};
struct ProtoEnumDescriptor {
    std::string name;
    std::vector<ProtoEnumValueDescriptor> values;
};
struct ProtoMessageDescriptor {
    std::string name;
    std::vector<ProtoFieldDescriptor> fields;
    std::vector<ProtoEnumDescriptor> enums;
};
/// One file for each message.
struct ProtoFileDescriptor {
    std::string name, package;
    std::vector<std::string> dependencies;
    std::vector<ProtoMessageDescriptor> messages;
    std::string syntax = "proto3";
};
struct ProtoFileSet {
    std::vector<ProtoFileDescriptor> files;
};

template <>
struct ProtoSchema<ProtoFieldDescriptor> {
    static constexpr std::string_view kName = "google.protobuf.FieldDescriptorProto";
    static constexpr std::tuple kFields{
        ProtoField{1, "name", &ProtoFieldDescriptor::name}, ProtoField{3, "number", &ProtoFieldDescriptor::number},
        ProtoField{4, "label", &ProtoFieldDescriptor::label}, ProtoField{5, "type", &ProtoFieldDescriptor::type},
        ProtoField{6, "type_name", &ProtoFieldDescriptor::type_name}};
};
template <>
struct ProtoSchema<ProtoEnumValueDescriptor> {
    static constexpr std::string_view kName = "google.protobuf.EnumValueDescriptorProto";
    static constexpr std::tuple kFields{ProtoField{1, "name", &ProtoEnumValueDescriptor::name},
                                        ProtoField{2, "number", &ProtoEnumValueDescriptor::number}};
};
template <>
struct ProtoSchema<ProtoEnumDescriptor> {
    static constexpr std::string_view kName = "google.protobuf.EnumDescriptorProto";
    static constexpr std::tuple kFields{ProtoField{1, "name", &ProtoEnumDescriptor::name},
                                        ProtoField{2, "value", &ProtoEnumDescriptor::values}};
};
template <>
struct ProtoSchema<ProtoMessageDescriptor> {
    static constexpr std::string_view kName = "google.protobuf.DescriptorProto";
    static constexpr std::tuple kFields{ProtoField{1, "name", &ProtoMessageDescriptor::name},
                                        ProtoField{2, "field", &ProtoMessageDescriptor::fields},
                                        ProtoField{4, "enum_type", &ProtoMessageDescriptor::enums}};
};
template <>
struct ProtoSchema<ProtoFileDescriptor> {
    static constexpr std::string_view kName = "google.protobuf.FileDescriptorProto";
    static constexpr std::tuple kFields{ProtoField{1, "name", &ProtoFileDescriptor::name},
                                        ProtoField{2, "package", &ProtoFileDescriptor::package},
                                        ProtoField{3, "dependency", &ProtoFileDescriptor::dependencies},
                                        ProtoField{4, "message_type", &ProtoFileDescriptor::messages},
                                        ProtoField{12, "syntax", &ProtoFileDescriptor::syntax}};
};
template <>
struct ProtoSchema<ProtoFileSet> {
    static constexpr std::string_view kName = "google.protobuf.FileDescriptorSet";
    static constexpr std::tuple kFields{ProtoField{1, "file", &ProtoFileSet::files}};
};

/// The file of "package.Name": "package/Name.proto", and of google's "google/protobuf/name.proto".
inline ProtoFileDescriptor empty_proto_file(std::string_view full_name) {
    const std::size_t dot = full_name.rfind('.');
    ProtoFileDescriptor file;
    file.package = full_name.substr(0, dot);
    std::string name(full_name.substr(dot + 1)), folder = file.package;
    file.messages.push_back({name, {}, {}});
    std::ranges::replace(folder, '.', '/');
    if (folder.starts_with("google/"))
        std::ranges::transform(name, name.begin(), [](unsigned char c) { return std::tolower(c); });
    file.name = folder + "/" + name + ".proto";
    return file;
}

template <ProtoMessage Message>
void add_proto_file(ProtoFileSet& set);

template <class T>
void describe_field(ProtoFileSet& set, ProtoFileDescriptor& file, ProtoFieldDescriptor& field) {
    if constexpr (ProtoMessage<T>) {
        field.type = static_cast<std::int32_t>(ProtoType::message);
        field.type_name = "." + std::string(ProtoSchema<T>::kName);
        add_proto_file<T>(set);
        const std::string used = empty_proto_file(ProtoSchema<T>::kName).name;
        if (std::ranges::find(file.dependencies, used) == file.dependencies.end())
            file.dependencies.push_back(used);
    } else if constexpr (std::is_enum_v<T>) {
        field.type = static_cast<std::int32_t>(ProtoType::enum_);
        field.type_name = "." + std::string(ProtoSchema<T>::kParent) + "." + std::string(ProtoSchema<T>::kName);
        ProtoEnumDescriptor values{std::string(ProtoSchema<T>::kName), {}};
        for (const std::string_view name : ProtoSchema<T>::kValues)
            values.values.push_back({std::string(name), static_cast<std::int32_t>(values.values.size())});
        file.messages[0].enums.push_back(std::move(values));
    } else if constexpr (std::is_same_v<T, std::string>) {
        field.type = static_cast<std::int32_t>(ProtoType::string);
    } else if constexpr (std::is_same_v<T, ProtoBytes>) {
        field.type = static_cast<std::int32_t>(ProtoType::bytes);
    } else {
        field.type = static_cast<std::int32_t>(ProtoNumber<T>::kType);
    }
}
template <class T>
struct ProtoValue {  ///< of a field that may be left out
    using type = T;
};
template <class T>
struct ProtoValue<std::optional<T>> {
    using type = T;
};

/// Adds the message's file after those that it depends on, unless it is there.
template <ProtoMessage Message>
void add_proto_file(ProtoFileSet& set) {
    ProtoFileDescriptor file = empty_proto_file(ProtoSchema<Message>::kName);
    if (std::ranges::find(set.files, file.name, &ProtoFileDescriptor::name) != set.files.end()) return;
    const auto add = [&]<class M, class T>(const ProtoField<M, T>& f) {
        ProtoFieldDescriptor field{std::string(f.name), f.number};
        using Item = typename ProtoItem<T>::type;
        if constexpr (std::is_void_v<Item>) {
            describe_field<typename ProtoValue<T>::type>(set, file, field);
        } else {
            field.label = 3;
            describe_field<Item>(set, file, field);
        }
        file.messages[0].fields.push_back(std::move(field));
    };
    std::apply([&](const auto&... field) { (add(field), ...); }, ProtoSchema<Message>::kFields);
    set.files.push_back(std::move(file));
}

/// The bytes of the FileDescriptorSet that defines the message.
template <ProtoMessage Message>
[[nodiscard]] std::vector<std::uint8_t> proto_descriptors() {
    ProtoFileSet set;
    add_proto_file<Message>(set);
    std::vector<std::uint8_t> bytes;
    encode_proto(set, bytes);
    return bytes;
}

}  // namespace narpa
