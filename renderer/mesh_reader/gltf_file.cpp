#include "renderer/mesh_reader/gltf_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <fstream>

#include "base/file_bytes.h"
#include "base/text/base64.h"
#include "base/text/text_lines.h"
#include "renderer/assets/meshes/mesh_readers.h"

namespace narpa {

namespace {

using nlohmann::json;

std::uint32_t word(std::string_view bytes, std::size_t at) {
    std::uint32_t x = 0;
    for (std::size_t i = 0; i < 4; ++i) x |= std::uint32_t{static_cast<unsigned char>(bytes[at + i])} << 8 * i;
    return x;
}

std::string percent_decoded(std::string_view uri) {
    const auto digit = [](char c) {
        return c >= '0' && c <= '9' ? c - '0' : (c | 0x20) >= 'a' && (c | 0x20) <= 'f' ? (c | 0x20) - 'a' + 10 : -1;
    };
    std::string out;
    for (std::size_t i = 0; i < uri.size(); ++i) {
        const bool is_code =
            uri[i] == '%' && i + 2 < uri.size() && digit(uri[i + 1]) >= 0 && digit(uri[i + 2]) >= 0;
        out += is_code ? static_cast<char>(16 * digit(uri[i + 1]) + digit(uri[i + 2])) : uri[i];
        if (is_code) i += 2;
    }
    return out;
}

/// Names of all extensions that objects of the document have.
void collect_extensions(const json& value, int depth, std::set<std::string>& names) {
    if (depth > 64 || !value.is_structured()) return;
    for (const auto& [key, inner] : value.items()) {
        if (key == "extensions" && inner.is_object())
            for (const auto& extension : inner.items()) names.insert(extension.key());
        if (key != "extras") collect_extensions(inner, depth + 1, names);
    }
}

bool is_any_of(std::string_view name, std::span<const std::string_view> names) {
    return std::ranges::find(names, name) != names.end();
}

/// Extensions that are read.
constexpr std::array<std::string_view, 11> kRead{"KHR_mesh_quantization",
                                                 "KHR_draco_mesh_compression",
                                                 "KHR_texture_transform",
                                                 "KHR_materials_emissive_strength",
                                                 "KHR_materials_pbrSpecularGlossiness",
                                                 "KHR_materials_transmission",
                                                 "KHR_materials_ior",
                                                 "EXT_mesh_gpu_instancing",
                                                 "EXT_texture_webp",
                                                 "KHR_xmp_json_ld",
                                                 "KHR_xmp"};
/// Images of other formats: textures that have no other image are not used, with a warning.
constexpr std::array<std::string_view, 3> kImages{"KHR_texture_basisu", "MSFT_texture_dds", "EXT_texture_avif"};
/// Compressed data: where the file also has the plain data, these are used.
constexpr std::array<std::string_view, 2> kCompression{"EXT_meshopt_compression", "KHR_meshopt_compression"};

}  // namespace

const json* member(const json& object, const char* name) {
    if (!object.is_object()) return nullptr;
    const auto found = object.find(name);
    return found == object.end() ? nullptr : &*found;
}

double number_or(const json& object, const char* name, double otherwise) {
    const json* value = member(object, name);
    if (value == nullptr) return otherwise;
    if (!value->is_number()) gltf_fail(fmt::format("\"{}\" is {}, expected a number", name, value->type_name()));
    return value->get<double>();
}

std::size_t count_or(const json& object, const char* name, std::size_t otherwise) {
    const double x = number_or(object, name, static_cast<double>(otherwise));
    if (!(x >= 0 && x <= 1e15 && x == std::floor(x)))
        gltf_fail(fmt::format("{} is {}, expected a whole number", name, x));
    return static_cast<std::size_t>(x);
}

std::string text_or(const json& object, const char* name, const char* otherwise) {
    const json* text = member(object, name);
    return text != nullptr && text->is_string() ? text->get<std::string>() : otherwise;
}

std::int64_t index_or_none(const json& object, const char* name) {
    const json* value = member(object, name);
    if (value == nullptr) return -1;
    const double x = number_or(object, name, 0);
    if (!(x >= 0 && x <= 1e9 && x == std::floor(x)))
        gltf_fail(fmt::format("\"{}\" is {}, expected an index", name, x));
    return static_cast<std::int64_t>(x);
}

const json* extension_of_object(const json& object, const char* name) {
    const json* extensions = member(object, "extensions");
    return extensions == nullptr ? nullptr : member(*extensions, name);
}

void numbers_into(const json& object, const char* name, std::span<double> out) {
    const json* value = member(object, name);
    if (value == nullptr) return;
    if (!value->is_array() || value->size() != out.size() ||
        !std::ranges::all_of(*value, [](const json& x) { return x.is_number(); }))
        gltf_fail(fmt::format("\"{}\": expected an array of {} numbers", name, out.size()));
    std::ranges::transform(*value, out.begin(), [](const json& x) { return x.get<double>(); });
}

GltfFile::GltfFile(std::string path) : path_(std::move(path)) {
    Result<std::string> bytes = read_file(path_);
    if (!bytes) gltf_fail(bytes.error().what);
    if (bytes->starts_with("glTF")) {
        read_binary(*std::move(bytes));
    } else {
        const std::size_t start = bytes->find_first_not_of(" \t\r\n", bytes->starts_with("\xef\xbb\xbf") ? 3 : 0);
        if (start == std::string::npos || (*bytes)[start] != '{')
            gltf_fail("expected a glTF document: JSON, or binary");
        root_ = json::parse(*bytes);
    }
    if (!root_.is_object() || member(root_, "asset") == nullptr)
        gltf_fail("no \"asset\" in it, expected a glTF document");
    const json& asset = root_.at("asset");
    const std::string version = text_or(asset, "version", "2.0"), least = text_or(asset, "minVersion", "2.0");
    if ((!version.starts_with("1") && !version.starts_with("2.")) || (version.starts_with("2.") && least != "2.0"))
        gltf_fail(fmt::format("glTF of version {} (at least {}), expected 2.0", version, least));
}

bool GltfFile::is_version_1() const {
    return text_or(root_.at("asset"), "version", "2.0").starts_with("1");
}

void GltfFile::read_binary(std::string bytes) {
    constexpr std::uint32_t kJson = 0x4e4f534a, kBin = 0x004e4942;
    if (bytes.size() < 20) gltf_fail("the binary glTF is cut short");
    if (word(bytes, 4) == 1) {
        root_ = {{"asset", {{"version", "1.0"}}}};
        return;
    }
    if (word(bytes, 4) != 2) gltf_fail(fmt::format("binary glTF of version {}, expected 2", word(bytes, 4)));
    for (std::size_t at = 12; at + 8 <= std::min<std::size_t>(bytes.size(), word(bytes, 8));) {
        const std::size_t size = word(bytes, at), kind = word(bytes, at + 4);
        if (size > bytes.size() - at - 8)
            gltf_fail(fmt::format("a chunk of {} bytes, the file has {} left: it is cut short", size,
                                  bytes.size() - at - 8));
        if (kind == kJson && root_.is_null())
            root_ = json::parse(bytes.begin() + static_cast<std::ptrdiff_t>(at + 8),
                                bytes.begin() + static_cast<std::ptrdiff_t>(at + 8 + size));
        else if (kind == kBin && binary_chunk_.empty())
            binary_chunk_ = bytes.substr(at + 8, size);
        at += 8 + size;
    }
}

void GltfFile::check_extensions() {
    std::set<std::string> required, used;
    for (const auto& [key, names] :
         {std::pair("extensionsRequired", &required), std::pair("extensionsUsed", &used)})
        if (const json* list = member(root_, key); list != nullptr && list->is_array())
            for (const json& name : *list)
                if (name.is_string()) names->insert(name.get<std::string>());
    for (const std::string& name : required)
        if (!is_any_of(name, kRead) && !is_any_of(name, kImages))
            gltf_fail(
                fmt::format("the file requires the glTF extension {}, which is not read; expected a file exported "
                            "without it",
                            name));
    collect_extensions(root_, 0, used);
    std::string ignored;
    for (const std::string& name : used)
        if (!is_any_of(name, kRead) && !is_any_of(name, kImages) && !is_any_of(name, kCompression))
            ignored += (ignored.empty() ? "" : ", ") + name;
    if (!ignored.empty()) warn("glTF extensions that are not used: " + ignored);
}

const json& GltfFile::item(const char* array, std::int64_t index) const {
    const json* all = member(root_, array);
    const std::size_t size = all != nullptr && all->is_array() ? all->size() : 0;
    if (index < 0 || static_cast<std::size_t>(index) >= size)
        gltf_fail(fmt::format("\"{}\" {} is used, counted from 0; the file has {}", array, index, size));
    return (*all)[static_cast<std::size_t>(index)];
}

bool GltfFile::data_of_uri(const std::string& uri, std::string& bytes) {
    if (!uri.starts_with("data:")) return false;
    const std::size_t comma = uri.find(',');
    if (comma == std::string::npos) gltf_fail("a data URI without a comma");
    const std::string_view head = std::string_view(uri).substr(0, comma),
                           body = std::string_view(uri).substr(comma + 1);
    if (!head.ends_with(";base64")) {
        bytes = percent_decoded(body);
        return true;
    }
    const auto decoded = from_base64(body.find('%') == body.npos ? std::string(body) : percent_decoded(body));
    if (!decoded) gltf_fail("a data URI is not Base64");
    bytes = *decoded;
    return true;
}

std::string GltfFile::path_of_uri(const std::string& uri) const {
    std::string decoded = texture_path(path_, percent_decoded(uri));
    std::error_code problem;
    if (std::filesystem::exists(decoded, problem)) return decoded;
    std::string as_written = texture_path(path_, uri);
    return std::filesystem::exists(as_written, problem) ? as_written : decoded;
}

const std::string& GltfFile::buffer(std::int64_t index) {
    const auto known = buffers_.find(index);
    if (known != buffers_.end()) return known->second;
    const json& description = item("buffers", index);
    const json* uri = member(description, "uri");
    std::string bytes;
    if (uri == nullptr) {
        if (index != 0 || binary_chunk_.empty())
            gltf_fail(
                fmt::format("buffer {} has no data: it may be compressed (meshopt), which is not read", index));
        bytes = std::move(binary_chunk_);
    } else if (const auto text = uri->get<std::string>(); !data_of_uri(text, bytes)) {
        const std::string file = path_of_uri(text);
        std::ifstream in(file, std::ios::binary);
        if (!in) gltf_fail(fmt::format("its buffer \"{}\" cannot be opened", file));
        bytes = text_lines::rest_of(in);
    }
    if (const std::size_t size = count_or(description, "byteLength", 0); bytes.size() < size)
        gltf_fail(fmt::format("buffer {} has {} bytes, expected {}", index, bytes.size(), size));
    return buffers_.emplace(index, std::move(bytes)).first->second;
}

std::string_view GltfFile::view(std::int64_t index) {
    const json& description = item("bufferViews", index);
    const std::string& bytes = buffer(index_or_none(description, "buffer"));
    const std::size_t from = count_or(description, "byteOffset", 0), size = count_or(description, "byteLength", 0);
    if (from > bytes.size() || size > bytes.size() - from)
        gltf_fail(fmt::format("buffer view {} has bytes {} to {}, its buffer has {}", index, from, from + size,
                              bytes.size()));
    return std::string_view(bytes).substr(from, size);
}

void GltfFile::warn(std::string_view what) {
    std::string text = fmt::format("{}: {}", path_, what);
    if (std::ranges::find(warnings, text) == warnings.end()) warnings.push_back(std::move(text));
}

}  // namespace narpa
