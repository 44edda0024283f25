target_sources(narpa_protocols PRIVATE video/embedded_line.cpp video/y4m.cpp)
