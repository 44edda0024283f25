target_sources(narpa_rehearsal PRIVATE judge/bus_record.cpp judge/gates.cpp judge/judge.cpp judge/judge_gates.cpp judge/port_state.cpp
                                       judge/statistics.cpp judge/verdict.cpp)
