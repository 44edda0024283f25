/// make_scene docking|craft|descent|small_body|tag_board|landing|debris|terrain OUTDIR - writes the meshes,
/// textures and tables of a scene. The same bytes each time.
#include <cstdio>
#include <exception>
#include <string>
#include <string_view>

#include "scenes/generate/scenes.h"
#include "scenes/generate/textures.h"

namespace narpa::scenes {
namespace {

struct Output {
    std::string directory;

    void mesh(const std::string& name, const Mesh& mesh, const std::vector<MaterialSpec>& materials,
              MeshParts parts = MeshParts::all) const {
        mesh.write_obj(directory + "/" + name + ".obj", name + ".mtl", parts);
        write_mtl(directory + "/" + name + ".mtl", materials);
        say(name, mesh);
    }
    /// Of one material, which the scenes give: a fourth of the size, for large meshes.
    void plain_mesh(const std::string& name, const Mesh& mesh, MeshParts parts = MeshParts::untextured) const {
        mesh.write_ply(directory + "/" + name + ".ply", parts);
        say(name, mesh);
    }

private:
    static void say(const std::string& name, const Mesh& mesh) {
        std::printf("%s: %zu triangles\n", name.c_str(), mesh.triangle_count());
    }
};

bool write_scene(std::string_view scene, const Output& out) {
    if (scene == "docking") {
        out.mesh("station", build_station(), scene_materials());
        out.mesh("chaser", build_chaser(), scene_materials());
        write_textures(out.directory);
        write_approach(out.directory + "/approach.csv");
    } else if (scene == "craft") {
        out.mesh("craft", build_craft(), craft_materials(), MeshParts::positions);
    } else if (scene == "descent") {
        out.plain_mesh("terrain", build_terrain(), MeshParts::all);
        write_ground_texture(out.directory);
    } else if (scene == "small_body") {
        out.plain_mesh("small_body", build_small_body());
    } else if (scene == "tag_board") {
        out.mesh("tag_board", build_tag_board(), tag_board_materials());
    } else if (scene == "landing") {
        out.plain_mesh("landing_site", build_landing_site());
        out.plain_mesh("landing_map", build_landing_map());
        out.mesh("lander", build_lander(), lander_materials());
    } else if (scene == "debris") {
        for (const DebrisName& d : kDebrisNames) out.mesh(d.name, build_debris(d.kind), debris_materials());
        write_debris(out.directory + "/debris.csv");
    } else if (scene == "terrain") {
        write_highland(out.directory + "/highland.png");
    } else {
        return false;
    }
    return true;
}

}  // namespace
}  // namespace narpa::scenes

int main(int argc, char** argv) {
    try {
        if (argc == 3 && narpa::scenes::write_scene(argv[1], {argv[2]})) return 0;
    } catch (const std::exception& e) {
        std::fprintf(stderr, "make_scene: %s\n", e.what());
        return 1;
    }
    std::fputs(
        "usage: make_scene docking|craft|descent|small_body|tag_board|landing|debris|terrain OUTDIR   (an existing "
        "folder)\n",
        stderr);
    return 2;
}
