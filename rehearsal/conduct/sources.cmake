target_sources(narpa_rehearsal PRIVATE conduct/campaign.cpp conduct/campaign_report.cpp conduct/chart.cpp conduct/child.cpp conduct/conduct.cpp conduct/folder.cpp conduct/lidar_port.cpp
                                       conduct/page.cpp conduct/page_parts.cpp conduct/rerun.cpp)
