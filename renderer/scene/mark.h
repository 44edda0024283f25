/// renderer/scene/mark.h - points of a body that a camera finds by themselves: lamps, reflectors, square tags. They
/// are data for navigations and estimators; the body's mesh shows them.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>

#include "base/pose.h"

namespace narpa {

/// A set of square tags with one number each: names and sizes of the dictionaries of OpenCV's module aruco, in the
/// order of its enumeration.
struct TagDictionary {
    std::string_view name;
    int tags = 0;
};
inline constexpr std::array<TagDictionary, 21> kTagDictionaries{{
    {"4X4_50", 50},           {"4X4_100", 100},      {"4X4_250", 250},      {"4X4_1000", 1000},
    {"5X5_50", 50},           {"5X5_100", 100},      {"5X5_250", 250},      {"5X5_1000", 1000},
    {"6X6_50", 50},           {"6X6_100", 100},      {"6X6_250", 250},      {"6X6_1000", 1000},
    {"7X7_50", 50},           {"7X7_100", 100},      {"7X7_250", 250},      {"7X7_1000", 1000},
    {"ARUCO_ORIGINAL", 1024}, {"APRILTAG_16h5", 30}, {"APRILTAG_25h9", 35}, {"APRILTAG_36h10", 2320},
    {"APRILTAG_36h11", 587},
}};

struct Mark {
    enum class Kind : std::uint8_t {
        lamp,       ///< a disc or sphere that shines
        reflector,  ///< the same, bright in the light of a lamp beside the camera
        tag,        ///< a square tag of a dictionary
    };
    static constexpr std::array<std::string_view, 3> kKindNames{"lamp", "reflector", "tag"};

    std::string name;
    Kind kind = Kind::lamp;
    /// Origin: its optical centre. z: out of its face. Of a tag, x is right and y up in its image.
    Rigid3 T_body_mark{};
    bool is_spherical = false;  ///< of a lamp or reflector: a sphere, not a disc
    double radius_m = 0;        ///< lamp, reflector
    int dictionary = 0;         ///< tag: index in kTagDictionaries
    int id = 0;                 ///< tag
    double side_m = 0;          ///< tag: of its black square
};

}  // namespace narpa
