target_sources(narpa_rehearsal PRIVATE navigation/attitude_track.cpp navigation/autopilot.cpp navigation/flight_control.cpp
                                       navigation/guidance.cpp navigation/leg_path.cpp navigation/relative_motion.cpp
                                       navigation/sight_model.cpp navigation/sightings.cpp navigation/state_estimator.cpp)
