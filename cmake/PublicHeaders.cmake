# The headers that a user of the installed libraries includes, as <narpa/...>. What they include is installed with them.
set(NARPA_PUBLIC_HEADERS
  base/pose.h base/result.h base/stop.h
  protocols/can/messages.h protocols/can/dbc.h protocols/can/candump.h protocols/ledger.h protocols/estimate.h
  protocols/lidar/lidar_model.h protocols/lidar/pattern_lidar.h protocols/lidar/velodyne.h protocols/video/embedded_line.h protocols/video/y4m.h
  drivers/can/can_bus.h drivers/lidar/packet_sink.h drivers/lidar/packet_source.h drivers/video/video_sink.h
  drivers/video/video_source.h
  renderer/scene/scene.h renderer/scene_file/scene_file.h renderer/geometry/tracer.h renderer/frame/camera_image.h
  renderer/detector/detector.h renderer/lidar/lidar_shot.h renderer/image/image_file.h
  estimator/pose/pose_estimate.h estimator/filter/pose_filter.h
  emulator/emulator.h emulator/world.h tracking/online_estimator.h
  rehearsal/scenario/scenario.h)
