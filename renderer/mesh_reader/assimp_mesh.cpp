#include <assimp/importerdesc.h>
#include <assimp/scene.h>
#include <fmt/format.h>

#include <algorithm>
#include <assimp/Importer.hpp>
#include <iterator>
#include <sstream>

#include "renderer/mesh_reader/mesh_reader.h"

namespace narpa {

namespace {

class Walk {
public:
    Walk(const aiScene& scene, const std::string& path) : scene_(scene), path_(path) {}

    MeshMessage read() {
        if (scene_.mNumMaterials > kMaxMaterials)
            return {.error =
                        fmt::format("{} materials, at most {} can be used", scene_.mNumMaterials, kMaxMaterials)};
        for (unsigned i = 0; i < scene_.mNumMaterials; ++i)
            materials_.push_back(from_assimp(scene_, *scene_.mMaterials[i], path_, soup_.warnings));
        if (materials_.empty()) materials_.push_back(grey_material());
        if (scene_.mRootNode) read_node(*scene_.mRootNode, aiMatrix4x4t<double>());
        warn_of_unused();
        return {.error = problem_, .soup = std::move(soup_), .materials = std::move(materials_)};
    }

private:
    void warn(std::string_view what) { soup_.warnings.push_back(fmt::format("{}: {}", path_, what)); }

    void warn_of_unused() {
        const auto any = [&](auto has) {
            return std::any_of(scene_.mMeshes, scene_.mMeshes + scene_.mNumMeshes, has);
        };
        if (scene_.mNumAnimations > 0) warn("animations are not used: nodes are as they are stored");
        if (any([](const aiMesh* m) { return m->HasBones(); }))
            warn("skins are not used: meshes are as they are stored");
        if (any([](const aiMesh* m) { return m->mNumAnimMeshes > 0; })) warn("morph targets are not used");
        if (any([](const aiMesh* m) {
                return (m->mPrimitiveTypes & (aiPrimitiveType_POINT | aiPrimitiveType_LINE)) != 0;
            }))
            warn("points and lines are not used");
        if (any([](const aiMesh* m) { return m->GetNumColorChannels() > 1; }))
            warn("second colours of vertices are not used");
    }

    void read_node(const aiNode& node, const aiMatrix4x4t<double>& parent) {
        const aiMatrix4x4& t = node.mTransformation;
        const aiMatrix4x4t<double> here =
            parent * aiMatrix4x4t<double>(t.a1, t.a2, t.a3, t.a4, t.b1, t.b2, t.b3, t.b4, t.c1, t.c2, t.c3, t.c4,
                                          t.d1, t.d2, t.d3, t.d4);
        for (unsigned i = 0; i < node.mNumMeshes; ++i) read_part(*scene_.mMeshes[node.mMeshes[i]], here);
        for (unsigned i = 0; i < node.mNumChildren; ++i) read_node(*node.mChildren[i], here);
    }

    void read_part(const aiMesh& part, const aiMatrix4x4t<double>& T) {
        if (part.mMaterialIndex >= materials_.size()) {
            problem_ = fmt::format("a part has material {}, counted from 0, of {}", part.mMaterialIndex,
                                   materials_.size());
            return;
        }
        const auto first_position = static_cast<std::uint32_t>(soup_.positions.size());
        const auto first_normal = static_cast<std::uint32_t>(soup_.normals.size());
        const auto first_uv = static_cast<std::uint32_t>(soup_.uvs.size());
        const auto first_colour = static_cast<std::uint32_t>(soup_.colours.size());
        const bool has_uv = part.HasTextureCoords(0), has_colours = part.HasVertexColors(0);
        for (unsigned i = 0; i < part.mNumVertices; ++i) {
            const aiVector3D& p = part.mVertices[i];
            const aiVector3t<double> w = T * aiVector3t<double>(p.x, p.y, p.z);
            soup_.positions.push_back({w.x, w.y, w.z});
            if (has_uv) soup_.uvs.push_back({part.mTextureCoords[0][i].x, part.mTextureCoords[0][i].y});
            if (has_colours) {
                const aiColor4D& c = part.mColors[0][i];
                soup_.colours.push_back({c.r, c.g, c.b});
            }
        }
        if (part.HasNormals()) read_normals(part, T);
        const bool mirrored = aiMatrix3x3t<double>(T).Determinant() < 0;
        const auto corner = [&](const aiFace& face, unsigned k) {
            const unsigned v = face.mIndices[mirrored ? face.mNumIndices - 1 - k : k];
            TriangleSoup::Corner c{.position = first_position + v};
            if (has_uv) c.uv = first_uv + v;
            if (part.HasNormals()) c.normal = first_normal + v;
            if (has_colours) c.colour = first_colour + v;
            return c;
        };
        for (unsigned f = 0; f < part.mNumFaces; ++f)
            if (is_sound(part.mFaces[f], part.mNumVertices)) read_face(part.mFaces[f], corner, part.mMaterialIndex);
    }

    /// Assimp does not check the indices of some formats.
    bool is_sound(const aiFace& face, unsigned vertices) {
        if (face.mNumIndices > kMaxCorners)
            problem_ = fmt::format("a face of {} corners, expected at most {}", face.mNumIndices, kMaxCorners);
        for (unsigned k = 0; k < face.mNumIndices; ++k)
            if (face.mIndices[k] >= vertices)
                problem_ = fmt::format("a face has vertex {}, counted from 0, of {}", face.mIndices[k], vertices);
        return problem_.empty();
    }

    /// Points and lines are left out.
    template <class CornerOf>
    void read_face(const aiFace& face, CornerOf corner, unsigned material_index) {
        const auto material = static_cast<std::uint16_t>(material_index);
        if (face.mNumIndices == 3)
            soup_.triangles.push_back({{corner(face, 0), corner(face, 1), corner(face, 2)}, material});
        if (face.mNumIndices <= 3) return;
        std::vector<Vec3> points;
        for (unsigned k = 0; k < face.mNumIndices; ++k) points.push_back(soup_.positions[corner(face, k).position]);
        for (const auto& t : triangulate(points))
            soup_.triangles.push_back({{corner(face, t[0]), corner(face, t[1]), corner(face, t[2])}, material});
    }

    void read_normals(const aiMesh& part, const aiMatrix4x4t<double>& T) {
        const aiMatrix3x3t<double> R = aiMatrix3x3t<double>(T).Inverse().Transpose();
        for (unsigned i = 0; i < part.mNumVertices; ++i) {
            const aiVector3D& n = part.mNormals[i];
            const aiVector3t<double> w = R * aiVector3t<double>(n.x, n.y, n.z);
            soup_.normals.push_back({static_cast<float>(w.x), static_cast<float>(w.y), static_cast<float>(w.z)});
        }
    }

    const aiScene& scene_;
    const std::string& path_;
    TriangleSoup soup_;
    std::vector<PlainMaterial> materials_;
    std::string problem_;
};

/// Unregisters all other importers: when that of the extension fails, Assimp tries dozens of others, by the first
/// bytes of the file.
void keep_importer_of(const std::string& path, Assimp::Importer& importer) {
    const std::string extension = extension_of(path).substr(1);
    for (std::size_t i = importer.GetImporterCount(); i-- > 0;) {
        std::istringstream extensions(importer.GetImporterInfo(i)->mFileExtensions);
        const std::istream_iterator<std::string> first(extensions), last;
        if (std::find(first, last, extension) == last) importer.UnregisterLoader(importer.GetImporter(i));
    }
}

}  // namespace

MeshMessage read_with_assimp(const std::string& path) {
    Assimp::Importer importer;
    keep_importer_of(path, importer);
    const aiScene* scene = importer.ReadFile(path, 0);
    if (scene == nullptr)
        return {.error = fmt::format("not a mesh that can be read: {}", importer.GetErrorString())};
    return Walk(*scene, path).read();
}

}  // namespace narpa
