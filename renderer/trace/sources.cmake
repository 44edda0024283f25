# Embree 4 where it is installed, else Embree 3; renderer/trace/embree.h holds what differs.
find_package(embree 4 QUIET)
if(NOT embree_FOUND)
  find_package(embree 3 REQUIRED)
endif()
find_package(TBB REQUIRED)
target_sources(narpa_renderer PRIVATE trace/body_bounds.cpp trace/box_tree.cpp trace/budget_frame.cpp trace/camera_image.cpp
                                      trace/camera_packet.cpp trace/first_hit.cpp trace/frame_error.cpp trace/frame_light.cpp
                                      trace/frame_passes.cpp trace/guide.cpp trace/lidar_shot.cpp trace/lights.cpp
                                      trace/mesh_packets.cpp trace/mesh_scene.cpp trace/mesh_topology.cpp trace/path.cpp trace/pixel_looks.cpp
                                      trace/sample_plan.cpp trace/screen_cover.cpp trace/shading.cpp trace/shared_bounces.cpp trace/surface_hit.cpp
                                      trace/tiny_bodies.cpp trace/tiny_light.cpp trace/tracer.cpp trace/tracer_packets.cpp)
# Loops over the lanes of a packet: without these GCC leaves most of them scalar. Neither changes a result.
set_source_files_properties(trace/camera_packet.cpp trace/frame_light.cpp trace/path.cpp trace/pixel_looks.cpp trace/screen_cover.cpp trace/shared_bounces.cpp trace/mesh_packets.cpp trace/surface_hit.cpp trace/tracer_packets.cpp PROPERTIES COMPILE_OPTIONS "-O3;-fno-trapping-math")
target_compile_definitions(narpa_renderer PRIVATE NARPA_EMBREE_MAJOR=${embree_VERSION_MAJOR})
target_link_libraries(narpa_renderer PRIVATE embree TBB::tbb)
