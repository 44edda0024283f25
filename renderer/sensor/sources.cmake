target_sources(narpa_renderer PRIVATE sensor/detector.cpp)
