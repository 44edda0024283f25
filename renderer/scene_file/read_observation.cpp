// [observer], `orbit` of a body and `track` of a camera: what is seen from the ground (docs/atmosphere.md).
#include <fmt/format.h>

#include <algorithm>

#include "base/constants.h"
#include "renderer/ephemeris/observer.h"
#include "renderer/scene_file/scene_parts.h"

namespace narpa {
namespace {

constexpr Range kAngle_deg{.low = -360, .high = 360};
constexpr TableKey kObserverRows[]{
    {"latitude_deg", rows::number({.low = -90, .high = 90}), "the geodetic latitude, north positive"},
    {"longitude_deg", rows::number(kAngle_deg), "the longitude, east positive"},
    {"height_m", rows::number({.low = -1000, .high = 20'000})},
    {"ut1_utc_s", rows::number({.low = -0.9, .high = 0.9})},
    {"temperature_c", rows::number({.low = -80, .high = 60})},
    {"pressure_hpa", rows::number({.low = 0, .high = 1200})},
    {"refraction", rows::boolean()},
    {"earth", rows::text()},
    {"sees", rows::texts()},
    {"sun", rows::boolean()},
};
constexpr TableKey kOrbitRows[]{
    {"semi_major_axis_m", rows::number({.low = 6.4e6, .high = 1e9}), "a length from the Earth's centre"},
    {"eccentricity", rows::number({.low = 0, .high = 1, .high_open = true})},
    {"inclination_deg", rows::number(kAngle_deg)},
    {"ascending_node_deg", rows::number(kAngle_deg)},
    {"argument_of_perigee_deg", rows::number(kAngle_deg)},
    {"mean_anomaly_deg", rows::number(kAngle_deg)},
};
constexpr TableKey kTrackingRows[]{{"track", rows::text()}, {"azimuth_elevation_deg", rows::pair(kAngle_deg)}};

ObserverPlace read_place(TableReader& table) {
    ObserverPlace place;
    place.latitude_rad = kRadPerDeg * table.number("latitude_deg").value_or(0);
    place.longitude_rad = kRadPerDeg * table.number("longitude_deg").value_or(0);
    place.height_m = table.number("height_m").value_or(0);
    place.ut1_utc_s = table.number("ut1_utc_s").value_or(0);
    place.temperature_k = 273.15 + table.number("temperature_c").value_or(10);
    place.pressure_hpa = table.number("pressure_hpa").value_or(1010);
    return place;
}

/// Keeps an observer above the surface of the Earth's ellipsoid in spite of rounding errors of nanometres.
void stand_on_earth(TableReader& table, ObserverPlace& place) {
    constexpr double kAbove_m = 1e-3;
    if (!table.has("earth")) return;
    if (place.height_m < 0) table.fail("height_m", "is below the surface of `earth`, expected at least 0");
    place.height_m = std::max(place.height_m, kAbove_m);
}

/// Gives the body of the Earth its attitude and rate.
void turn_earth(TableReader& table, const GroundObserver& observer, std::vector<Body>& bodies) {
    const auto name = table.text("earth");
    if (!name) return;
    for (Body& b : bodies)
        if (b.name == *name) {
            b.initial.T_world_body.q = observer.q_world_earth();
            b.initial.rate_rad_s = {0, 0, 7.292115e-5};
            return;
        }
    table.fail("earth", fmt::format("there is no body \"{}\", expected the name of a [[body]]", *name));
}

}  // namespace

constinit const TableKeys kObserverKeys{.rows = kObserverRows}, kOrbitKeys{.rows = kOrbitRows},
    kTrackingKeys{.rows = kTrackingRows};

void read_orbit(TableReader& body_table, Body& body) {
    auto table = body_table.table("orbit");
    if (!table) return;
    for (const std::string_view key : {"position_m", "velocity_m_s"})
        body_table.refuse(key, "the body has an orbit, which gives it; expected one of the two");
    OrbitalElements o;
    table->read("semi_major_axis_m", o.semi_major_axis_m);
    o.eccentricity = table->number("eccentricity").value_or(0);
    const auto angle = [&](std::string_view key) { return kRadPerDeg * table->number(key).value_or(0); };
    o.inclination_rad = angle("inclination_deg");
    o.ascending_node_rad = angle("ascending_node_deg");
    o.argument_of_perigee_rad = angle("argument_of_perigee_deg");
    o.mean_anomaly_rad = angle("mean_anomaly_deg");
    table->finish();
    body.course = orbit_course(o, body.initial);
    body.initial = body.course->at(0);
}

void read_observer(TableReader& root, SceneReading& reading) {
    auto table = root.table("observer");
    if (!table) return;
    Scene& scene = reading.scene;
    ObserverPlace place = read_place(*table);
    stand_on_earth(*table, place);
    const bool refracted = table->boolean("refraction").value_or(true);
    if (!reading.has_epoch) root.fail("observer", "the time is not known, expected an \"epoch\" in [scene]");
    const Observing observing{GroundObserver(place, scene.epoch_unix_ns), refracted};
    turn_earth(*table, observing.at_start, scene.bodies);
    const auto apparent = table->texts("sees");
    for (const std::string& name : apparent.value_or(std::vector<std::string>{})) {
        bool known = false;
        for (Body& b : scene.bodies) {
            if (b.name != name) continue;
            known = true;
            b.course = apparent_course(observing, b);
            b.initial = b.course->at(0);
        }
        if (!known) table->fail("sees", fmt::format("there is no body \"{}\", expected names of [[body]]", name));
    }
    if (scene.sun && table->boolean("sun").value_or(true))
        scene.sun->direction = observing.at_start.apparent_sun(refracted);
    table->finish();
    reading.observer = observing;
}

void read_tracking(TableReader& table, const SceneReading& reading, Camera& camera) {
    const auto track = table.text("track");
    const auto pointing = table.pair("azimuth_elevation_deg");
    if (!track && !pointing) return;
    const char* const key = track ? "track" : "azimuth_elevation_deg";
    if (track && pointing) return table.fail(key, "there is an azimuth_elevation_deg too, expected one of the two");
    for (const std::string_view other : {"mount", "position_m", "attitude_wxyz", "look_at"})
        table.refuse(other, "the camera stands at the [observer] and points by itself; expected one of the two");
    if (!reading.observer) return table.fail(key, "is seen by an observer, expected an [observer]");
    const Observing& from = *reading.observer;
    if (pointing) {
        camera.course = camera_towards(from, (*pointing)[0] * kRadPerDeg, (*pointing)[1] * kRadPerDeg);
    } else if (*track == "sun" && reading.scene.sun) {
        camera.course = camera_towards_sun(from);
    } else {
        const auto body = std::find_if(reading.scene.bodies.begin(), reading.scene.bodies.end(),
                                       [&](const Body& b) { return b.name == *track; });
        if (body == reading.scene.bodies.end())
            return table.fail(key, fmt::format("there is no body \"{}\", expected one, or \"sun\"", *track));
        camera.course = camera_towards(from, *body);
    }
    camera.T_mount_camera = camera.course->at(0).T_world_body;
}

}  // namespace narpa
