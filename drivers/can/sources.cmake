target_sources(narpa_drivers PRIVATE can/can_bus.cpp can/candump_log.cpp can/datagram.cpp can/remote_clock.cpp can/slcan_client.cpp
                                     can/slcan_hub.cpp can/slcan_stream.cpp can/socketcan.cpp
                                     can/udp_multicast_bus.cpp)
