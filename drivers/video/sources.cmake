target_sources(narpa_drivers PRIVATE outbox.cpp video/null.cpp video/open_video_sink.cpp video/open_video_source.cpp
                                     video/v4l2.cpp video/v4l2_device.cpp video/v4l2_source.cpp video/y4m.cpp
                                     video/y4m_source.cpp)
