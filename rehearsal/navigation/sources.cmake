target_sources(narpa_rehearsal PRIVATE navigation/attitude_track.cpp navigation/autopilot.cpp navigation/bus_link.cpp
                                       navigation/flight_control.cpp navigation/guidance.cpp navigation/intake.cpp
                                       navigation/leg_path.cpp navigation/lockstep_loop.cpp
                                       navigation/navigation_log.cpp navigation/node.cpp navigation/real_time_loop.cpp
                                       navigation/relative_motion.cpp navigation/sensor_wires.cpp
                                       navigation/sight_model.cpp navigation/sightings.cpp
                                       navigation/state_estimator.cpp navigation/turn_buffer.cpp)
