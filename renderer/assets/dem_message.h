/// renderer/assets/dem_message.h - a DemMessage as bytes on a pipe.
#pragma once

#include "renderer/assets/dem_process.h"
#include "renderer/assets/meshes/mesh_message.h"

namespace narpa::mesh_message {

/// Sends or receives a whole message; false where the stream ends before it.
template <class Stream>
bool transfer(Stream& stream, DemMessage& m) {
    if (!plain(stream, m.magic) || m.magic != DemMessage::kMagic) return false;
    if (!array(stream, m.error)) return false;
    if (!m.error.empty()) return true;
    TerrainMesh& t = m.terrain;
    return plain(stream, t.origin_m) && plain(stream, t.summary) && array(stream, t.positions) &&
           array(stream, t.normals) && array(stream, t.uvs) && array(stream, t.faces) &&
           list(stream, t.warnings, [&](std::string& text) { return array(stream, text); });
}

}  // namespace narpa::mesh_message
