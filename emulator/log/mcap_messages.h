/// emulator/log/mcap_messages.h - what a scene's sensors make, as messages that Foxglove shows: of a file
/// (mcap_log.h) or of a live view. No files and no threads.
///
/// Frames are world, body/NAME, camera/NAME and lidar/NAME. Times are of the simulation clock.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "protocols/foxglove/messages.h"
#include "protocols/lidar/lidar_model.h"
#include "renderer/scene/scene.h"

namespace narpa {

[[nodiscard]] foxglove::Vector3 to_foxglove(const Vec3& v) noexcept;
[[nodiscard]] foxglove::Quaternion to_foxglove(const Quat& q) noexcept;
[[nodiscard]] foxglove::Pose to_foxglove(const Rigid3& T) noexcept;

inline constexpr const char* kWorldFrame = "world";
[[nodiscard]] std::string frame_of(const Body& body);
[[nodiscard]] std::string frame_of(const Camera& camera);
[[nodiscard]] std::string frame_of(const Lidar& lidar);

/// `encoding` of a RawImage. Foxglove shows those of 8 bits a sample and mono16; Bayer mosaics of 16 bits have the
/// names that ROS gives them.
[[nodiscard]] std::string image_encoding(PixelFormat format);
/// `bytes` must live as long as the message.
[[nodiscard]] foxglove::RawImage raw_image(const Camera& camera, std::int64_t t_ns,
                                           std::span<const std::uint8_t> bytes);
/// Of the whole image. Models that Foxglove has no name for have their own.
[[nodiscard]] foxglove::CameraCalibration camera_calibration(const Camera& camera, std::int64_t t_ns);

/// Where the scene's frames are: bodies and their sensors.
class SceneTransforms {
public:
    explicit SceneTransforms(const Scene& scene);
    /// `bodies`: T_world_body of each.
    [[nodiscard]] foxglove::FrameTransforms at(std::int64_t t_ns, std::span<const Rigid3> bodies) const;

private:
    struct Rider {
        std::string parent, frame;
        Rigid3 T_parent_frame;
        std::shared_ptr<const Course> course;  ///< null: it is at rest in its parent's frame
    };
    std::vector<std::string> bodies_;
    std::vector<Rider> riders_;
};

/// The points of one sweep, from packets.
class SweepPoints {
public:
    explicit SweepPoints(const Lidar& lidar);

    /// `t_first_ns`: of the first shot of the sweep.
    void begin(std::int64_t t_first_ns);
    /// Adds what a reader decodes of a packet that starts at this time.
    void add(std::int64_t t_packet_ns, std::span<const std::uint8_t> packet);
    /// The message; valid until `begin`.
    [[nodiscard]] foxglove::PointCloud message() const;
    [[nodiscard]] std::int64_t t_first_ns() const noexcept { return t_first_ns_; }
    [[nodiscard]] std::size_t packet_bytes() const noexcept { return model_->spec().data_packet_bytes; }

private:
    std::shared_ptr<const LidarModel> model_;
    std::string frame_;
    std::vector<foxglove::PackedElementField> fields_;
    std::uint32_t stride_ = 0;
    std::int64_t t_first_ns_ = 0;
    std::vector<LidarPoint> decoded_;
    std::vector<std::uint8_t> data_;
};

}  // namespace narpa
