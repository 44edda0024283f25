# Embree 4 where it is installed, else Embree 3; renderer/trace/embree.h holds what differs.
find_package(embree 4 QUIET)
if(NOT embree_FOUND)
  find_package(embree 3 REQUIRED)
endif()
find_package(TBB REQUIRED)
target_sources(narpa_renderer PRIVATE trace/camera_image.cpp trace/lidar_shot.cpp trace/mesh_scene.cpp trace/mesh_topology.cpp
                                      trace/shading.cpp trace/tracer.cpp)
target_compile_definitions(narpa_renderer PRIVATE NARPA_EMBREE_MAJOR=${embree_VERSION_MAJOR})
target_link_libraries(narpa_renderer PRIVATE embree TBB::tbb)
