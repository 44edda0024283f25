/// renderer/assets/meshes/mesh_process.h - mesh files read in a process of their own, narpa-mesh-reader: a damaged
/// file can crash only that process.
#pragma once

#include <string>

#include "base/result.h"
#include "renderer/assets/meshes/mesh_file.h"
#include "renderer/assets/meshes/mesh_readers.h"

namespace narpa {

/// The extensions that are read this way, and how they are listed in errors.
bool is_read_in_process(const std::string& extension);
inline constexpr const char* kMeshExtensions = ".obj, .tab, .icq, .gltf, .glb, .ply, .stl, .3ds or .dae";

/// Starts narpa-mesh-reader, which is beside the running program or on PATH. Every length and index that it sends
/// is checked. Errors: those of the file; a limit that was reached; a crash of the process.
Result<TriangleSoup> read_soup_in_process(const std::string& path, const MeshReaderLimits& limits = {});

}  // namespace narpa
