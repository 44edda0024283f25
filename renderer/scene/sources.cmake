target_sources(narpa_renderer PRIVATE
    scene/assimp_material.cpp
    scene/based_on.cpp
    scene/load_files.cpp
    scene/mesh_assimp.cpp
    scene/mesh_file.cpp
    scene/mesh_material.cpp
    scene/mtl_file.cpp
    scene/obj_file.cpp
    scene/read_bodies.cpp
    scene/read_lights.cpp
    scene/read_materials.cpp
    scene/read_mounting.cpp
    scene/read_sensors.cpp
    scene/read_surroundings.cpp
    scene/scene_file.cpp
    scene/sun_direction.cpp
    scene/texture_file.cpp
    scene/toml_reader.cpp
    scene/triangulate.cpp)
# Assimp and ERFA by their plain names: assimp 5.2's CMake target asks for packages (draco, minizip) that its users need
# not have, and ERFA brings none.
target_link_libraries(narpa_renderer PRIVATE assimp erfa tomlplusplus::tomlplusplus fmt::fmt opencv_core opencv_imgcodecs)
