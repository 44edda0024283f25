target_sources(narpa_protocols PRIVATE lidar/position.cpp lidar/vlp16.cpp)
