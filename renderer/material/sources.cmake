target_sources(narpa_renderer PRIVATE material/albedo.cpp material/bsdf.cpp material/ggx.cpp
               material/ggx_albedo.cpp material/ggx_albedo_table.cpp material/hapke.cpp material/phong.cpp
               material/regolith.cpp material/smooth.cpp material/texture_levels.cpp material/texture_lookup.cpp)
