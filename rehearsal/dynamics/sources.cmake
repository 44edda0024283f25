target_sources(narpa_rehearsal PRIVATE dynamics/flight_log.cpp dynamics/node.cpp dynamics/orbit_motion.cpp
                                       dynamics/port_motion.cpp dynamics/rigid_body.cpp dynamics/simulation.cpp
                                       dynamics/thruster_model.cpp)
