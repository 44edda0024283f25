#include "renderer/keys/other_names.h"

#include <fmt/format.h>

#include <algorithm>

#include "base/text/nearest_name.h"

namespace narpa {
namespace {

/// Normalises a name, so that "FOV_deg" and "fovDeg" are equal.
std::string plain(std::string_view name) {
    std::string text;
    for (const char c : name)
        if (c != '_' && c != '-') text += c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
    return text;
}

/// A pixel format of another tool (plain()), and narpa's.
struct OtherFormat {
    std::string_view name, format;
};
constexpr OtherFormat kOtherFormats[]{
    {"mono10", "Y10"},         {"gray10le", "Y10"},       {"mono12", "Y12"},
    {"gray12le", "Y12"},       {"raw10", "Y10P"},         {"raw12", "Y12P"},
    {"mono8", "GREY"},         {"gray8", "GREY"},         {"y8", "GREY"},
    {"mono16", "Y16"},         {"gray16le", "Y16"},       {"rgb8", "RGB24"},
    {"rgb3", "RGB24"},         {"yuy2", "YUYV"},          {"yuyv422", "YUYV"},
    {"yuv422yuy2", "YUYV"},    {"bayerrggb8", "RGGB8"},   {"bayergrbg8", "GRBG8"},
    {"bayergbrg8", "GBRG8"},   {"bayerbggr8", "BGGR8"},   {"bayerrggb16", "RGGB16"},
    {"bayergrbg16", "GRBG16"}, {"bayergbrg16", "GBRG16"}, {"bayerbggr16", "BGGR16"},
};

}  // namespace

std::span<const OtherName> other_names() {
    static const std::vector<OtherName> names{
        // a camera's field of view
        {"fov", {"fov_horizontal_deg", "fov_diagonal_deg"}},
        {"fovdeg", {"fov_horizontal_deg", "fov_diagonal_deg"}},
        {"fovrad", {"fov_horizontal_deg", "fov_diagonal_deg"}},
        {"fieldofview", {"fov_horizontal_deg", "fov_diagonal_deg"}},
        {"fieldofviewdeg", {"fov_horizontal_deg", "fov_diagonal_deg"}},
        {"hfov", {"fov_horizontal_deg"}},
        {"hfovdeg", {"fov_horizontal_deg"}},
        {"horizontalfov", {"fov_horizontal_deg"}},
        {"horizontalfovdeg", {"fov_horizontal_deg"}},
        {"fovx", {"fov_horizontal_deg"}},
        {"fovxdeg", {"fov_horizontal_deg"}},
        {"vfov", {"fov_horizontal_deg", "fov_diagonal_deg", "intrinsics"}},
        {"vfovdeg", {"fov_horizontal_deg", "fov_diagonal_deg", "intrinsics"}},
        {"verticalfov", {"fov_horizontal_deg", "fov_diagonal_deg", "intrinsics"}},
        {"fovverticaldeg", {"fov_horizontal_deg", "fov_diagonal_deg", "intrinsics"}},
        {"fovy", {"fov_horizontal_deg", "fov_diagonal_deg", "intrinsics"}},
        {"dfov", {"fov_diagonal_deg"}},
        {"diagonalfovdeg", {"fov_diagonal_deg"}},
        {"focallength", {"intrinsics"}},
        {"focallengthpx", {"intrinsics"}},
        {"cameramatrix", {"intrinsics"}},
        {"k", {"intrinsics"}},
        // its image
        {"width", {"resolution"}},
        {"height", {"resolution"}},
        {"imagesize", {"resolution"}},
        {"imagewidth", {"resolution"}},
        {"size", {"resolution", "size_m"}},
        {"fps", {"rate_hz"}},
        {"framerate", {"rate_hz"}},
        {"frameratehz", {"rate_hz"}},
        {"updaterate", {"rate_hz"}},
        {"frequency", {"rate_hz"}},
        {"pixelformat", {"format"}},
        {"encoding", {"format"}},
        // its detector
        {"sensor", {"detector"}},
        {"exposure", {"exposure_s"}},
        {"exposuretime", {"exposure_s"}},
        {"exposurems", {"exposure_s"}},
        {"exposureus", {"exposure_s"}},
        {"integrationtime", {"exposure_s"}},
        {"integrationtimes", {"exposure_s"}},
        {"shutterspeed", {"exposure_s"}},
        {"ev", {"exposure_stops"}},
        {"fstop", {"f_number"}},
        {"aperture", {"f_number", "aperture_diameter_m"}},
        {"qe", {"quantum_efficiency"}},
        {"wellcapacity", {"full_well_e"}},
        {"saturationcapacity", {"full_well_e"}},
        {"gain", {"gain_e_per_dn"}},
        {"conversiongain", {"gain_e_per_dn"}},
        {"readoutnoise", {"read_noise_e"}},
        {"bitdepth", {"bits"}},
        {"bitsperpixel", {"bits"}},
        {"adcbits", {"bits"}},
        {"pixelsize", {"pixel_pitch_m"}},
        {"pixelsizeum", {"pixel_pitch_m"}},
        {"pixelpitchum", {"pixel_pitch_m"}},
        {"offset", {"black_level_dn"}},
        {"biasdn", {"black_level_dn"}},
        // where things are
        {"location", {"position_m"}},
        {"translation", {"position_m"}},
        {"quaternion", {"attitude_wxyz"}},
        {"orientation", {"attitude_wxyz"}},
        {"rotation", {"attitude_wxyz"}},
        {"target", {"look_at"}},
        {"lookat", {"look_at"}},
        {"parent", {"mount"}},
        {"frame", {"mount"}},
        {"angularvelocity", {"rate_rad_s"}},
        // bodies and what they are made of
        {"object", {"body"}},
        {"objects", {"body"}},
        {"model", {"mesh"}},
        {"obj", {"mesh"}},
        {"shape", {"mesh", "sphere", "ellipsoid"}},
        {"radius", {"radius_m", "sphere"}},
        {"semiaxes", {"semi_axes_m", "ellipsoid"}},
        {"bsdf", {"material"}},
        {"diffuse", {"albedo"}},
        {"color", {"albedo", "colour"}},
        {"basecolor", {"albedo"}},
        {"reflectivity", {"albedo"}},
        {"index", {"ior"}},
        {"refractiveindex", {"ior"}},
        {"shininess", {"exponent"}},
        {"type", {"kind"}},
        // light
        {"emitter", {"light"}},
        {"background", {"ambient", "stars"}},
        {"irradiance", {"irradiance_w_m2"}},
        {"solarirradiance", {"irradiance_w_m2"}},
        // rendering
        {"renderer", {"render"}},
        {"integrator", {"render", "method"}},
        {"samples", {"spp"}},
        {"samplesperpixel", {"spp"}},
        {"samplecount", {"spp"}},
        {"bounces", {"max_depth"}},
        {"maxbounces", {"max_depth"}},
        {"depth", {"max_depth"}},
    };
    return names;
}

std::string key_meant(std::string_view unknown, const std::vector<std::string>& known) {
    const std::string name = plain(unknown);
    std::string keys;
    for (const OtherName& other : other_names())
        if (other.name == name)
            for (const std::string_view key : other.keys)
                if (std::ranges::find(known, key) != known.end())
                    keys += fmt::format("{}\"{}\"", keys.empty() ? "" : " or ", key);
    if (!keys.empty()) return fmt::format("; did you mean {}?", keys);
    if (std::string text = did_you_mean(unknown, known); !text.empty()) return text;
    // The same quantity in another unit: "attitude_deg" for "attitude_wxyz".
    const std::string_view quantity = unknown.substr(0, unknown.rfind('_') + 1);
    const auto same = std::ranges::find_if(known, [&](const std::string& k) {
        return k.starts_with(quantity) && k.find('_', quantity.size()) == std::string::npos;
    });
    return quantity.empty() || same == known.end() ? std::string() : fmt::format("; did you mean \"{}\"?", *same);
}

std::string word_meant(std::string_view unknown, const std::vector<std::string_view>& words) {
    const auto other = std::ranges::find(kOtherFormats, plain(unknown), &OtherFormat::name);
    if (other != std::end(kOtherFormats) && std::ranges::find(words, other->format) != words.end())
        return fmt::format("; did you mean \"{}\"?", other->format);
    return did_you_mean(unknown, std::vector<std::string>(words.begin(), words.end()));
}

}  // namespace narpa
