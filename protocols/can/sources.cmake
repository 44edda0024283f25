target_sources(narpa_protocols PRIVATE can/candump.cpp can/closed_loop.cpp can/crc.cpp can/dbc.cpp can/estimate.cpp can/messages.cpp can/signal_set.cpp
                                       can/slcan.cpp can/telemetry.cpp can/udp_multicast.cpp)
