#include "emulator/log/mcap_messages.h"

#include <algorithm>
#include <bit>
#include <cctype>

#include "protocols/little_endian.h"
#include "renderer/projection/projection_kind.h"

namespace narpa {
namespace {

using NumericType = foxglove::PackedElementField::NumericType;

/// The fields of a point, little-endian; the last only where the unit measures velocities.
struct PointField {
    const char* name;
    NumericType type;
    std::uint32_t offset;
};
constexpr std::array<PointField, 9> kPointFields{{{"x", NumericType::float32, 0},
                                                  {"y", NumericType::float32, 4},
                                                  {"z", NumericType::float32, 8},
                                                  {"range", NumericType::float32, 12},
                                                  {"t", NumericType::uint32, 16},
                                                  {"intensity", NumericType::uint16, 20},
                                                  {"beam", NumericType::uint16, 22},
                                                  {"echo", NumericType::uint8, 24},
                                                  {"velocity", NumericType::float32, 28}}};
constexpr std::uint32_t kStride = 28, kStrideWithVelocity = 32;

void put_float(std::uint8_t* at, double value) {
    put_le(at, std::bit_cast<std::uint32_t>(static_cast<float>(value)));
}
template <std::unsigned_integral T>
void put_clamped(std::uint8_t* at, std::int64_t value) {
    put_le(at, static_cast<T>(std::clamp<std::int64_t>(value, 0, std::numeric_limits<T>::max())));
}

}  // namespace

foxglove::Vector3 to_foxglove(const Vec3& v) noexcept {
    return {v.x, v.y, v.z};
}
foxglove::Quaternion to_foxglove(const Quat& q) noexcept {
    return {q.x, q.y, q.z, q.w};
}
foxglove::Pose to_foxglove(const Rigid3& T) noexcept {
    return {to_foxglove(T.t), to_foxglove(T.q)};
}

std::string frame_of(const Body& body) {
    return "body/" + body.name;
}
std::string frame_of(const Camera& camera) {
    return "camera/" + camera.name;
}
std::string frame_of(const Lidar& lidar) {
    return "lidar/" + lidar.name;
}

std::string image_encoding(PixelFormat format) {
    const PixelFormatRow& row = row_of(format);
    if (format == PixelFormat::yuyv) return "yuyv";
    if (format == PixelFormat::rgb24) return "rgb8";
    std::string name = "mono";
    if (is_bayer(format)) {
        name = "bayer_";
        for (const char band : row.mosaic)
            name += static_cast<char>(std::tolower(static_cast<unsigned char>(band)));
    }
    return name + (row.is_16_bit ? "16" : "8");
}

foxglove::RawImage raw_image(const Camera& c, std::int64_t t_ns, std::span<const std::uint8_t> bytes) {
    const auto width = static_cast<std::uint32_t>(c.width);
    return {foxglove::timestamp(t_ns),
            width,
            static_cast<std::uint32_t>(c.height),
            image_encoding(c.format),
            width * static_cast<std::uint32_t>(bytes_per_pixel(c.format)),
            bytes,
            frame_of(c)};
}

foxglove::CameraCalibration camera_calibration(const Camera& c, std::int64_t t_ns) {
    foxglove::CameraCalibration message{.timestamp = foxglove::timestamp(t_ns),
                                        .width = static_cast<std::uint32_t>(c.width),
                                        .height = static_cast<std::uint32_t>(c.height),
                                        .R = {1, 0, 0, 0, 1, 0, 0, 0, 1},
                                        .frame_id = frame_of(c)};
    ProjectionParameters p = opencv_parameters(*c.model);
    if (p.kind == nullptr) p = c.model->parameters();
    if (p.kind == nullptr) return message;  // of no kind that files name
    message.distortion_model = p.kind->name;
    if (p.kind->opencv == "fisheye")
        message.distortion_model = "kannala_brandt";
    else
        for (const RosName& name : p.kind->ros)
            if (p.values.size() <= name.parameters_max) {
                message.distortion_model = name.name;
                break;
            }
    message.D = p.values;
    const Pinhole& k = p.pinhole;
    message.K = {k.fx, 0, k.cx, 0, k.fy, k.cy, 0, 0, 1};
    message.P = {k.fx, 0, k.cx, 0, 0, k.fy, k.cy, 0, 0, 0, 1, 0};
    return message;
}

SceneTransforms::SceneTransforms(const Scene& scene) {
    for (const Body& body : scene.bodies) bodies_.push_back(frame_of(body));
    const auto parent = [&](int mount) {
        return mount < 0 ? std::string(kWorldFrame) : bodies_[static_cast<std::size_t>(mount)];
    };
    for (const Camera& c : scene.cameras)
        riders_.push_back({parent(c.mount), frame_of(c), c.T_mount_camera, c.course});
    for (const Lidar& l : scene.lidars) riders_.push_back({parent(l.mount), frame_of(l), l.T_mount_lidar, nullptr});
}

foxglove::FrameTransforms SceneTransforms::at(std::int64_t t_ns, std::span<const Rigid3> bodies) const {
    foxglove::FrameTransforms message;
    const auto add = [&](const std::string& parent, const std::string& frame, const Rigid3& T) {
        message.transforms.push_back(
            {foxglove::timestamp(t_ns), parent, frame, to_foxglove(T.t), to_foxglove(T.q)});
    };
    for (std::size_t i = 0; i < bodies_.size(); ++i) add(kWorldFrame, bodies_[i], bodies[i]);
    for (const Rider& r : riders_)
        add(r.parent, r.frame,
            r.course ? r.course->at(static_cast<double>(t_ns) * 1e-9).T_world_body : r.T_parent_frame);
    return message;
}

SweepPoints::SweepPoints(const Lidar& lidar)
    : model_(lidar.model), frame_(frame_of(lidar)), decoded_(lidar.model->spec().points_per_packet) {
    stride_ = model_->spec().measures_velocity ? kStrideWithVelocity : kStride;
    for (const PointField& f : kPointFields)
        if (f.offset < stride_) fields_.push_back({f.name, f.offset, f.type});
}

void SweepPoints::begin(std::int64_t t_first_ns) {
    t_first_ns_ = t_first_ns;
    data_.clear();
}

void SweepPoints::add(std::int64_t t_packet_ns, std::span<const std::uint8_t> packet) {
    const std::size_t n = model_->points(packet, decoded_), before = data_.size();
    data_.resize(before + n * stride_);
    std::uint8_t* at = data_.data() + before;
    for (const LidarPoint& p : std::span(decoded_).first(n)) {
        const Vec3 position = p.position_m();
        put_float(at, position.x);
        put_float(at + 4, position.y);
        put_float(at + 8, position.z);
        put_float(at + 12, p.range_m);
        put_clamped<std::uint32_t>(at + 16, t_packet_ns + p.t_offset_ns - t_first_ns_);
        put_clamped<std::uint16_t>(at + 20, p.intensity);
        put_clamped<std::uint16_t>(at + 22, p.beam);
        put_clamped<std::uint8_t>(at + 24, p.echo);
        if (stride_ == kStrideWithVelocity) put_float(at + 28, p.velocity_m_s);
        at += stride_;
    }
}

foxglove::PointCloud SweepPoints::message() const {
    return {foxglove::timestamp(t_first_ns_), frame_, to_foxglove(Rigid3{}), stride_, fields_, data_};
}

}  // namespace narpa
