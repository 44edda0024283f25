target_sources(narpa_rehearsal PRIVATE navigation/flight_control.cpp navigation/guidance.cpp navigation/leg_path.cpp
                                       navigation/relative_motion.cpp)
