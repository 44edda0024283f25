target_sources(narpa_rehearsal PRIVATE scenario/scenario.cpp scenario/scenario_file.cpp)
