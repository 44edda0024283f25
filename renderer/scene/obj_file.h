/// renderer/scene/obj_file.h - Wavefront OBJ and MTL (Alias/Wavefront, Advanced Visualizer manual, appendix B1).
///
/// Our own reader, because Assimp 5.2 leaves out vertices such as `v .5 0 0` in silence (so that every later index
/// means another vertex), takes `1.#IND` for 1, gives up at MTL extensions, and cannot name the line of an error.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "base/result.h"
#include "renderer/scene/triangle_soup.h"

namespace narpa {

/// Faces of any number of corners, with their materials; points, lines, curves, groups and smoothing groups are
/// passed over. Errors carry line and column: a token that is no number, an index of 0 or out of range, a face of
/// fewer than 3 corners.
Result<TriangleSoup> read_obj(const std::string& path);

/// Adds the materials of an MTL file by name (docs/scene.md has the mapping). `warnings` gets what is left out.
Status read_mtl(const std::string& path, std::map<std::string, MeshMaterial>& materials,
                std::vector<std::string>& warnings);

}  // namespace narpa
