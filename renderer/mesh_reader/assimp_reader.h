/// renderer/mesh_reader/assimp_reader.h - mesh files -> triangles and materials, by Assimp. Only the program
/// narpa-mesh-reader does this: damaged files crash Assimp 5.2, or keep it busy for minutes.
#pragma once

#include <string>
#include <vector>

#include "base/result.h"
#include "renderer/assets/mesh_message.h"

struct aiMaterial;
struct aiScene;

namespace narpa {

/// Node transforms are applied. Only the importer of the file's extension is used, whatever the file begins with.
MeshMessage read_with_assimp(const std::string& path);

/// Checks for errors in a PLY file that Assimp 5.2 does not detect: it searches for ever if the header has no end,
/// or has more elements than a file of this size can hold; in a text file it takes numbers of other lines for
/// missing ones.
Status check_ply(const std::string& path);

/// A material that Assimp read from the file `path`. `warnings` gets what is left out.
PlainMaterial from_assimp(const aiScene& scene, const aiMaterial& m, const std::string& path,
                          std::vector<std::string>& warnings);

}  // namespace narpa
