target_sources(narpa_drivers PRIVATE outbox.cpp video/null.cpp video/open_video_sink.cpp video/v4l2.cpp
                                     video/y4m.cpp)
