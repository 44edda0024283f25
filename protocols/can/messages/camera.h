/// protocols/can/messages/camera.h - cameras that are operated while they run: commands, triggers, replies, states.
#pragma once

#include "protocols/camera_control.h"
#include "protocols/can/codec.h"

namespace narpa {

inline constexpr std::uint32_t kCameraCommandBaseId = 0x760, kCameraTriggerBaseId = 0x770;  ///< to cameras
inline constexpr std::uint32_t kCameraReplyBaseId = 0x780, kCameraStateBaseId = 0x790;      ///< from cameras
inline constexpr std::uint32_t kSyncId = 0x080;  ///< to cameras; CiA 301: the SYNC object

inline constexpr double kGainSteps_per_dB = 100;
inline constexpr auto kTriggerModeChoices = numbered(kTriggerModes);
inline constexpr auto kCameraAnswerChoices = numbered(kCameraAnswers);

/// The settings of a camera, in classic frames from `first` on. In a command, signals may be "not available".
[[nodiscard]] constexpr std::array<Signal, 11> camera_setting_signals(std::uint8_t first) {
    const auto at = [&](int frame) { return static_cast<std::uint8_t>(first + frame); };
    return {{
        {"Running", "", "Whether frames are exposed", 1, true, {at(0), 0, 8}, {}, kOffOnChoices},
        {"Trigger", "", "Source of the exposure's start", 1, true, {at(0), 8, 8}, {}, kTriggerModeChoices},
        {"AutoExposure", "", "Automatic exposure time", 1, true, {at(0), 16, 8}, {}, kOffOnChoices},
        {"Binning", "", "n: blocks of n x n pixels have their mean", 1, true, {at(0), 24, 8}},
        {"Gain", "dB", "Factor on the gain of the scene's detector", kGainSteps_per_dB, true, {at(0), 32, 16}},
        {"Exposure", "ns", "Exposure time of one row", 1, true, {at(1), 0, 48}},
        {"RegionX", "px", "First column that is read out", 1, true, {at(2), 0, 24}},
        {"RegionY", "px", "First row that is read out", 1, true, {at(2), 24, 24}},
        {"RegionWidth", "px", "Columns that are read out", 1, true, {at(3), 0, 24}},
        {"RegionHeight", "px", "Rows that are read out", 1, true, {at(3), 24, 24}},
        {"Period", "ns", "Time between frames; minimum time between triggers", 1, true, {at(4), 0, 48}},
    }};
}

inline constexpr std::array<std::string_view, 6> kCameraCommandFrames{
    "CameraCommandCamera",   "CameraCommandSwitches", "CameraCommandExposure",
    "CameraCommandRegionXY", "CameraCommandRegionWH", "CameraCommandPeriod"};
inline constexpr auto kCameraCommandSignals = place_fd_signals(
    std::to_array<Signal>({{"Camera", "", "Index of the camera in the scene", 1, false, {0, 0, 8}}}),
    camera_setting_signals(1));
inline constexpr SetLayout kCameraCommandLayout =
    describe_set("CameraCommand", "camera command", "Changes a camera's settings; not available: unchanged",
                 kCameraCommandBaseId, kToNarpa, kCameraCommandFrames, kCameraCommandSignals);

template <>
struct Codec<CameraCommand> {
    static constexpr const SetLayout& layout = kCameraCommandLayout;
    static auto& addressee(auto& m) noexcept { return m.camera; }
    static void fields(auto& m, const auto& each) noexcept {
        each(m.camera, m.running, m.trigger, m.auto_exposure, m.binning, m.gain_cdb, m.exposure_ns, m.region_x,
             m.region_y, m.region_width, m.region_height, m.period_ns);
    }
    /// Whether values other than choices are possible is for the camera to decide.
    static DecodeStatus check(const RawSignals& raw) noexcept { return check_signals(layout.signals, raw, true); }
};

inline constexpr std::array<std::string_view, 2> kCameraTriggerFrames{"CameraTriggerCameras", "CameraTriggerTime"};
inline constexpr auto kCameraTriggerSignals = place_fd_signals(std::to_array<Signal>({
    {"Cameras", "", "Bit i: camera i of the scene", 1, false, {0, 0, 16}},
    {"AtOnce", "", "As soon as possible, instead of at Time", 1, false, {0, 16, 8}, {}, kOffOnChoices},
    {"Time", "ns", "Start of the exposure: simulation clock modulo 2^48 ns", 1, false, {1, 0, 48}},
}));
inline constexpr SetLayout kCameraTriggerLayout =
    describe_set("CameraTrigger", "camera trigger", "Exposes one frame of each camera named, at the same time",
                 kCameraTriggerBaseId, kToNarpa, kCameraTriggerFrames, kCameraTriggerSignals);

template <>
struct Codec<CameraTrigger> {
    static constexpr const SetLayout& layout = kCameraTriggerLayout;
    static void fields(auto& m, const auto& each) noexcept { each(m.cameras, m.at_once, m.t_ns); }
    static auto& addressee(auto& m) noexcept { return m.cameras; }
};

inline constexpr std::array<std::string_view, 2> kCameraReplyFrames{"CameraReplyAnswer", "CameraReplyTime"};
inline constexpr auto kCameraReplySignals = place_fd_signals(std::to_array<Signal>({
    {"Camera", "", "Index of the camera in the scene", 1, false, {0, 0, 8}},
    {"ToTrigger", "", "The reply is to a trigger, not to a command", 1, false, {0, 8, 8}, {}, kOffOnChoices},
    {"Answer", "", "Accepted, or the reason for refusal", 1, false, {0, 16, 8}, {}, kCameraAnswerChoices},
    {"Time",
     "ns",
     "First time of the settings, or start of the exposure: simulation clock modulo 2^48 ns",
     1,
     false,
     {1, 0, 48}},
}));
inline constexpr SetLayout kCameraReplyLayout =
    describe_set("CameraReply", "camera reply", "Counter: that of the command or trigger", kCameraReplyBaseId,
                 kFromNarpa, kCameraReplyFrames, kCameraReplySignals);

template <>
struct Codec<CameraReply> {
    static constexpr const SetLayout& layout = kCameraReplyLayout;
    static void fields(auto& m, const auto& each) noexcept { each(m.camera, m.to_trigger, m.answer, m.t_ns); }
};

inline constexpr std::array<std::string_view, 6> kCameraStateFrames{"CameraStateFrame",    "CameraStateSwitches",
                                                                    "CameraStateExposure", "CameraStateRegionXY",
                                                                    "CameraStateRegionWH", "CameraStatePeriod"};
inline constexpr auto kCameraStateSignals =
    place_fd_signals(std::to_array<Signal>({
                         {"Frame", "", "Frame number", 1, false, {0, 0, 32}},
                         {"Camera", "", "Index of the camera in the scene", 1, false, {0, 32, 8}},
                         {"CommandCounter", "", "Counter of the newest command in effect", 1, false, {0, 40, 8}},
                     }),
                     camera_setting_signals(1));
inline constexpr SetLayout kCameraStateLayout =
    describe_set("CameraState", "camera state", "Settings with which a frame was taken", kCameraStateBaseId,
                 kFromNarpa, kCameraStateFrames, kCameraStateSignals);

template <>
struct Codec<CameraState> {
    static constexpr const SetLayout& layout = kCameraStateLayout;
    static auto& counter(auto& m) noexcept { return m.frame; }
    static void fields(auto& m, const auto& each) noexcept {
        auto& s = m.settings;
        each(m.frame, m.camera, m.command_counter, s.running, s.trigger, s.auto_exposure, s.binning, s.gain_cdb,
             s.exposure_ns, s.region.x, s.region.y, s.region.width, s.region.height, s.period_ns);
    }
    /// Refuses negative values (except of the gain) and values that do not fit their member too.
    static DecodeStatus check(const RawSignals& raw) noexcept {
        for (std::size_t i = 0; i < layout.signals.size(); ++i) {
            const Signal& s = layout.signals[i];
            const std::int64_t most = s.name == "Binning" ? 255 : s.unit == "px" ? 65535 : raw[i];
            if ((raw[i] < 0 && s.unit != "dB") || raw[i] > most) return DecodeStatus::not_a_number;
        }
        return check_signals(layout.signals, raw, false);
    }
};

}  // namespace narpa
