/// renderer/assets/meshes/mesh_message.h - what narpa-mesh-reader sends to narpa, as bytes on a pipe. Both are on
/// one machine and from one build: numbers are in its byte order.
#pragma once

#include <algorithm>
#include <cstdint>
#include <string>
#include <type_traits>
#include <vector>

#include "base/result.h"
#include "renderer/assets/meshes/mesh_readers.h"

namespace narpa {

/// A material as the mesh file gives it. The numbers are not checked.
struct PlainMaterial {
    enum class Kind : std::uint8_t { diffuse_and_lobe, metallic_roughness, glass };
    struct Numbers {
        Kind kind = Kind::diffuse_and_lobe;
        Rgb diffuse{}, specular{}, emission{};  ///< diffuse: base colour of metallic_roughness
        float exponent = 0, metallic = 1, roughness = 1, ior = 1.5f, normal_scale = 1;
        bool is_grey_by_default = false;
    } numbers;
    std::string name;
    MeshTexture colour{}, emission{}, normal{};
};

struct MeshMessage {
    static constexpr std::uint64_t kMagic = 0x3130'4853'454d'4e03;
    std::uint64_t magic = kMagic;
    std::string error{};  ///< empty: the mesh follows
    int line = 0, column = 0;
    TriangleSoup soup{};  ///< without its materials
    std::vector<PlainMaterial> materials{};
};

namespace mesh_message {

// `stream` is a sender or a receiver: `stream.bytes(data, size)` writes or fills them, and is false when that
// fails. A receiver changes what the references name.

template <class Stream, class T>
bool plain(Stream& stream, T& x) {
    static_assert(std::is_trivially_copyable_v<T>);
    return stream.bytes(&x, sizeof x);
}

/// A receiver fails where more is announced than it may take.
template <class Stream, class Array>
bool array(Stream& stream, Array& v) {
    using T = typename Array::value_type;
    static_assert(std::is_trivially_copyable_v<T>);
    constexpr std::size_t kStep = (std::size_t{1} << 20) / sizeof(T);
    std::uint64_t count = v.size();
    if (!plain(stream, count)) return false;
    if constexpr (Stream::kReceives) {
        if (count > stream.left() / sizeof(T)) return false;
        v.reserve(count);
    }
    for (std::size_t at = 0, n = 0; at < count; at += n) {
        n = std::min<std::size_t>(kStep, count - at);
        if constexpr (Stream::kReceives) v.resize(at + n);
        if (!stream.bytes(v.data() + at, n * sizeof(T))) return false;
    }
    return true;
}

template <class Stream, class T, class Each>
bool list(Stream& stream, std::vector<T>& v, Each each) {
    std::uint64_t count = v.size();
    if (!plain(stream, count)) return false;
    for (std::size_t i = 0; i < count; ++i) {
        if constexpr (Stream::kReceives) v.emplace_back();
        if (!each(v[i])) return false;
    }
    return true;
}

template <class Stream>
bool transfer(Stream& stream, MeshTexture& t) {
    return array(stream, t.file) && array(stream, t.bytes) && plain(stream, t.wrap);
}

template <class Stream>
bool transfer(Stream& stream, PlainMaterial& m) {
    return plain(stream, m.numbers) && array(stream, m.name) && transfer(stream, m.colour) &&
           transfer(stream, m.emission) && transfer(stream, m.normal);
}

/// Sends or receives a whole message; false where the stream ends before it.
template <class Stream>
bool transfer(Stream& stream, MeshMessage& m) {
    if (!plain(stream, m.magic) || m.magic != MeshMessage::kMagic) return false;
    if (!array(stream, m.error) || !plain(stream, m.line) || !plain(stream, m.column)) return false;
    if (!m.error.empty()) return true;
    TriangleSoup& s = m.soup;
    return array(stream, s.positions) && array(stream, s.normals) && array(stream, s.uvs) &&
           array(stream, s.colours) && array(stream, s.triangles.position) && array(stream, s.triangles.uv) &&
           array(stream, s.triangles.normal) && array(stream, s.triangles.colour) &&
           array(stream, s.triangles.materials) &&
           list(stream, s.warnings, [&](std::string& text) { return array(stream, text); }) &&
           list(stream, m.materials, [&](PlainMaterial& material) { return transfer(stream, material); });
}

}  // namespace mesh_message
}  // namespace narpa
