target_sources(narpa_renderer PRIVATE material/bsdf.cpp material/texture_lookup.cpp)
