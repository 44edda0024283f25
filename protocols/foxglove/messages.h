/// protocols/foxglove/messages.h - messages with the schemas that Foxglove publishes, and those of our own in the
/// package `narpa` where none of its schemas fits.
/// Source of names and numbers: github.com/foxglove/foxglove-sdk, schemas/proto/foxglove. Optional members that
/// narpa never sets are left out.
#pragma once

#include "protocols/foxglove/protobuf.h"

namespace narpa::foxglove {

struct Timestamp {
    std::int64_t seconds = 0;
    std::int32_t nanos = 0;  ///< 0 to 999,999,999, also before time 0
};
[[nodiscard]] constexpr Timestamp timestamp(std::int64_t t_ns) noexcept {
    const std::int64_t nanos = (t_ns % 1'000'000'000 + 1'000'000'000) % 1'000'000'000;
    return {(t_ns - nanos) / 1'000'000'000, static_cast<std::int32_t>(nanos)};
}

struct Vector3 {
    double x = 0, y = 0, z = 0;
};
struct Quaternion {
    double x = 0, y = 0, z = 0, w = 0;
};
struct Pose {
    Vector3 position{};
    Quaternion orientation{};
};

struct RawImage {
    Timestamp timestamp{};
    std::uint32_t width = 0, height = 0;
    std::string encoding{};
    std::uint32_t step = 0;  ///< bytes of a row
    ProtoBytes data{};
    std::string frame_id{};
};

struct CameraCalibration {
    Timestamp timestamp{};
    std::uint32_t width = 0, height = 0;
    std::string distortion_model{};
    std::vector<double> D{};
    std::vector<double> K{}, R{}, P{};  ///< row-major: 3 x 3, 3 x 3, 3 x 4
    std::string frame_id{};
};

struct PackedElementField {
    enum class NumericType : std::uint8_t { unknown, uint8, int8, uint16, int16, uint32, int32, float32, float64 };
    std::string name{};
    std::uint32_t offset = 0;  ///< bytes
    NumericType type = NumericType::unknown;
};
struct PointCloud {
    Timestamp timestamp{};
    std::string frame_id{};
    Pose pose{};  ///< of the cloud in that frame
    std::uint32_t point_stride = 0;
    std::vector<PackedElementField> fields{};
    ProtoBytes data{};
};

struct FrameTransform {
    Timestamp timestamp{};
    std::string parent_frame_id{}, child_frame_id{};
    Vector3 translation{};  ///< T_parent_child
    Quaternion rotation{};
};
struct FrameTransforms {
    std::vector<FrameTransform> transforms{};
};

struct PoseInFrame {
    Timestamp timestamp{};
    std::string frame_id{};
    Pose pose{};
};

struct Log {
    enum class Level : std::uint8_t { unknown, debug, info, warning, error, fatal };
    Timestamp timestamp{};
    Level level = Level::unknown;
    std::string message{}, name{};  ///< name: of what it is about
};

/// narpa.Estimate: a relative pose that was estimated from one frame.
struct Estimate {
    Timestamp timestamp{};             ///< mid-exposure
    std::string frame_id{}, target{};  ///< frames of the camera and of the target
    std::uint32_t frame = 0;           ///< its number
    std::string state{}, answer{};     ///< kEstimateStates, kAnswerKinds
    std::optional<Pose> pose{};        ///< T_camera_target by all frames so far
    std::vector<double> covariance{};  ///< 6 x 6, row-major: rotation in rad, then position in m; camera axes
    std::optional<Pose> measured{};    ///< by this frame alone
    std::vector<double> measured_covariance{};
};

}  // namespace narpa::foxglove

namespace narpa {

template <>
struct ProtoSchema<foxglove::Timestamp> {
    using M = foxglove::Timestamp;
    static constexpr std::string_view kName = "google.protobuf.Timestamp";
    static constexpr std::tuple kFields{ProtoField{1, "seconds", &M::seconds}, ProtoField{2, "nanos", &M::nanos}};
};
template <>
struct ProtoSchema<foxglove::Vector3> {
    using M = foxglove::Vector3;
    static constexpr std::string_view kName = "foxglove.Vector3";
    static constexpr std::tuple kFields{ProtoField{1, "x", &M::x}, ProtoField{2, "y", &M::y},
                                        ProtoField{3, "z", &M::z}};
};
template <>
struct ProtoSchema<foxglove::Quaternion> {
    using M = foxglove::Quaternion;
    static constexpr std::string_view kName = "foxglove.Quaternion";
    static constexpr std::tuple kFields{ProtoField{1, "x", &M::x}, ProtoField{2, "y", &M::y},
                                        ProtoField{3, "z", &M::z}, ProtoField{4, "w", &M::w}};
};
template <>
struct ProtoSchema<foxglove::Pose> {
    using M = foxglove::Pose;
    static constexpr std::string_view kName = "foxglove.Pose";
    static constexpr std::tuple kFields{ProtoField{1, "position", &M::position},
                                        ProtoField{2, "orientation", &M::orientation}};
};
template <>
struct ProtoSchema<foxglove::RawImage> {
    using M = foxglove::RawImage;
    static constexpr std::string_view kName = "foxglove.RawImage";
    static constexpr std::tuple kFields{
        ProtoField{1, "timestamp", &M::timestamp}, ProtoField{2, "width", &M::width},
        ProtoField{3, "height", &M::height},       ProtoField{4, "encoding", &M::encoding},
        ProtoField{5, "step", &M::step},           ProtoField{6, "data", &M::data},
        ProtoField{7, "frame_id", &M::frame_id}};
};
template <>
struct ProtoSchema<foxglove::CameraCalibration> {
    using M = foxglove::CameraCalibration;
    static constexpr std::string_view kName = "foxglove.CameraCalibration";
    static constexpr std::tuple kFields{ProtoField{1, "timestamp", &M::timestamp},
                                        ProtoField{2, "width", &M::width},
                                        ProtoField{3, "height", &M::height},
                                        ProtoField{4, "distortion_model", &M::distortion_model},
                                        ProtoField{5, "D", &M::D},
                                        ProtoField{6, "K", &M::K},
                                        ProtoField{7, "R", &M::R},
                                        ProtoField{8, "P", &M::P},
                                        ProtoField{9, "frame_id", &M::frame_id}};
};
template <>
struct ProtoSchema<foxglove::PackedElementField::NumericType> {
    static constexpr std::string_view kName = "NumericType", kParent = "foxglove.PackedElementField";
    static constexpr std::array<std::string_view, 9> kValues{"UNKNOWN", "UINT8", "INT8",    "UINT16", "INT16",
                                                             "UINT32",  "INT32", "FLOAT32", "FLOAT64"};
};
template <>
struct ProtoSchema<foxglove::PackedElementField> {
    using M = foxglove::PackedElementField;
    static constexpr std::string_view kName = "foxglove.PackedElementField";
    static constexpr std::tuple kFields{ProtoField{1, "name", &M::name}, ProtoField{2, "offset", &M::offset},
                                        ProtoField{3, "type", &M::type}};
};
template <>
struct ProtoSchema<foxglove::PointCloud> {
    using M = foxglove::PointCloud;
    static constexpr std::string_view kName = "foxglove.PointCloud";
    static constexpr std::tuple kFields{
        ProtoField{1, "timestamp", &M::timestamp}, ProtoField{2, "frame_id", &M::frame_id},
        ProtoField{3, "pose", &M::pose},           ProtoField{4, "point_stride", &M::point_stride},
        ProtoField{5, "fields", &M::fields},       ProtoField{6, "data", &M::data}};
};
template <>
struct ProtoSchema<foxglove::FrameTransform> {
    using M = foxglove::FrameTransform;
    static constexpr std::string_view kName = "foxglove.FrameTransform";
    static constexpr std::tuple kFields{
        ProtoField{1, "timestamp", &M::timestamp}, ProtoField{2, "parent_frame_id", &M::parent_frame_id},
        ProtoField{3, "child_frame_id", &M::child_frame_id}, ProtoField{4, "translation", &M::translation},
        ProtoField{5, "rotation", &M::rotation}};
};
template <>
struct ProtoSchema<foxglove::FrameTransforms> {
    using M = foxglove::FrameTransforms;
    static constexpr std::string_view kName = "foxglove.FrameTransforms";
    static constexpr std::tuple kFields{ProtoField{1, "transforms", &M::transforms}};
};
template <>
struct ProtoSchema<foxglove::PoseInFrame> {
    using M = foxglove::PoseInFrame;
    static constexpr std::string_view kName = "foxglove.PoseInFrame";
    static constexpr std::tuple kFields{ProtoField{1, "timestamp", &M::timestamp},
                                        ProtoField{2, "frame_id", &M::frame_id}, ProtoField{3, "pose", &M::pose}};
};
template <>
struct ProtoSchema<foxglove::Log::Level> {
    static constexpr std::string_view kName = "Level", kParent = "foxglove.Log";
    static constexpr std::array<std::string_view, 6> kValues{"UNKNOWN", "DEBUG", "INFO",
                                                             "WARNING", "ERROR", "FATAL"};
};
template <>
struct ProtoSchema<foxglove::Log> {
    using M = foxglove::Log;
    static constexpr std::string_view kName = "foxglove.Log";
    static constexpr std::tuple kFields{ProtoField{1, "timestamp", &M::timestamp},
                                        ProtoField{2, "level", &M::level}, ProtoField{3, "message", &M::message},
                                        ProtoField{4, "name", &M::name}};
};
template <>
struct ProtoSchema<foxglove::Estimate> {
    using M = foxglove::Estimate;
    static constexpr std::string_view kName = "narpa.Estimate";
    static constexpr std::tuple kFields{
        ProtoField{1, "timestamp", &M::timestamp}, ProtoField{2, "frame_id", &M::frame_id},
        ProtoField{3, "target", &M::target},       ProtoField{4, "frame", &M::frame},
        ProtoField{5, "state", &M::state},         ProtoField{6, "answer", &M::answer},
        ProtoField{7, "pose", &M::pose},           ProtoField{8, "covariance", &M::covariance},
        ProtoField{9, "measured", &M::measured},   ProtoField{10, "measured_covariance", &M::measured_covariance}};
};

}  // namespace narpa
