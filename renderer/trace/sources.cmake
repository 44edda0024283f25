# Embree 4 where it is installed, else Embree 3; renderer/trace/embree.h holds what differs.
find_package(embree 4 QUIET)
if(NOT embree_FOUND)
  find_package(embree 3 REQUIRED)
endif()
find_package(TBB REQUIRED)
target_sources(narpa_renderer PRIVATE trace/body_bounds.cpp trace/camera_image.cpp trace/camera_packet.cpp trace/first_hit.cpp
                                      trace/frame_light.cpp trace/guide.cpp trace/lidar_shot.cpp trace/lights.cpp trace/mesh_scene.cpp
                                      trace/mesh_topology.cpp trace/path.cpp
                                      trace/shading.cpp trace/surface_hit.cpp trace/tiny_bodies.cpp
                                      trace/tiny_light.cpp trace/tracer.cpp trace/tracer_packets.cpp)
target_compile_definitions(narpa_renderer PRIVATE NARPA_EMBREE_MAJOR=${embree_VERSION_MAJOR})
target_link_libraries(narpa_renderer PRIVATE embree TBB::tbb)
