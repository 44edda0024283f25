// narpa check - checks the scene and this machine; names what is missing and how to fix it.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "apps/cli.h"
#include "apps/commands/body_views.h"
#include "apps/commands/calibration.h"
#include "apps/commands/check_machine.h"
#include "apps/commands/check_scene.h"
#include "apps/commands/check_sensors.h"
#include "apps/device_options.h"
#include "apps/scene_argument.h"
#include "apps/warnings.h"
#include "base/write_file.h"
#include "dataset/recipe/recipe.h"
#include "emulator/world.h"
#include "protocols/can/dbc.h"
#include "rehearsal/scenario/scenario.h"
#include "renderer/keys/json_schema.h"
#include "renderer/keys/shipped_file.h"
#include "renderer/scene_file/lidar_description.h"
#include "renderer/scene_file/scene_file.h"
#include "renderer/trajectory/trajectory_description.h"

namespace narpa::cli {
namespace {

struct CheckOptions {
    SceneArgument scene;
    std::string dbc, calibration, schema;
    std::vector<std::string> devices;
    DeviceOptions named;
};

Status save_dbc(const Scene& scene, const std::string& path) {
    std::vector<CanBody> bodies;
    for (const Body& b : scene.bodies)
        if (b.can_id) bodies.push_back({b.name, *b.can_id});
    return write_file(path, write_dbc(bodies, static_cast<int>(scene.cameras.size())));
}

/// Prints the scenario; returns its part of the document.
nlohmann::json describe(const rehearsal::Scenario& s) {
    const auto names = [](const auto& list) {
        std::vector<std::string> out;
        for (const auto& one : list) out.push_back(one.name);
        return out;
    };
    const auto& n = s.navigation;
    say(fmt::format("scenario \"{}\": {}, at most {:g} s; its legs take about {:.0f} s", s.name, s.title,
                    s.duration_s, s.legs_duration_s()));
    if (s.legs_duration_s() > s.duration_s)
        warn(fmt::format("the run ends before its legs are flown: expected duration_s of [scenario] above {:.0f}",
                         std::ceil(s.legs_duration_s())));
    say(fmt::format("  scene: {}", s.scene));
    std::vector<std::string> sensors = n.cameras;
    if (n.camera_method != &camera_methods().front())
        for (std::string& camera : sensors) camera += fmt::format(" ({})", n.camera_method->measures);
    sensors.insert(sensors.end(), n.lidars.begin(), n.lidars.end());
    say(fmt::format("  {} flies to {}, by {}", s.chaser.body, s.target.body, fmt::join(sensors, ", ")));
    say(fmt::format("  legs: {}", fmt::join(names(s.legs), ", ")));
    return {{"file", s.file},
            {"name", s.name},
            {"scene", s.scene},
            {"cameras", n.cameras},
            {"lidars", n.lidars},
            {"legs", names(s.legs)},
            {"duration_s", s.duration_s},
            {"legs_s", s.legs_duration_s()}};
}

/// Kinds of files that have a schema.
struct SchemaRow {
    std::string name;
    const TableKeys& keys;
};
const std::array<SchemaRow, 5> kSchemas{{{"scene", kSceneFileKeys},
                                         {"lidar", kLidarDescriptionKeys},
                                         {"trajectory", kTrajectoryFileKeys},
                                         {"scenario", rehearsal::kScenarioFileKeys},
                                         {"dataset", dataset::kRecipeFileKeys}}};

Outcome print_schema(const std::string& name) {
    const auto row = std::ranges::find(kSchemas, name, &SchemaRow::name);
    fmt::print("{}", json_schema(row->keys, fmt::format("narpa {}", name)));
    return nlohmann::json();  // the schema is the one document
}

/// Where the argument names a scenario or a recipe of a data set: prints it, adds its part to the document, and
/// goes on with its scene.
Status find_scene(SceneArgument& argument, nlohmann::json& document) {
    const auto named = find_file(FileKind::scene, argument.file);
    if (named) return Ok{};
    if (const auto file = find_file(FileKind::scenario, argument.file)) {
        const auto scenario = rehearsal::read_scenario(*file, argument.sets);
        if (!scenario) return scenario.error();
        document["scenario"] = describe(*scenario);
        argument = {scenario->scene, scenario->scene_overrides};
    } else if (const auto recipe_file = find_file(FileKind::dataset, argument.file)) {
        const auto recipe = dataset::read_recipe(*recipe_file, argument.sets);
        if (!recipe) return recipe.error();
        say(fmt::format("recipe \"{}\" of a data set; its scene: {}", recipe->name, recipe->scene));
        document["dataset"] = {{"file", recipe->file}, {"name", recipe->name}, {"scene", recipe->scene}};
        argument = {recipe->scene, recipe->sets};
    } else {
        return named.error();
    }
    return Ok{};
}

Outcome check(const CheckOptions& o) {
    if (!o.schema.empty()) return print_schema(o.schema);
    if (o.scene.file.empty()) return Error{"SCENE is required"};
    nlohmann::json document;
    SceneArgument scene_argument = o.scene;
    if (auto named = find_scene(scene_argument, document); !named) return named.error();
    auto scene = scene_argument.load_anyway();
    if (!scene) return scene.error();
    auto world = World::create(*std::move(scene));
    if (!world) return world.error();
    print_scene(**world);
    nlohmann::json scene_document = describe_scene(**world);
    check_body_views(**world, scene_document);
    check_own_hulls(**world, scene_document);
    check_exposures(**world, scene_document);
    if (!o.calibration.empty()) {
        if (auto written = write_calibration((*world)->scene(), o.calibration); !written) return written.error();
        say("wrote " + o.calibration + "/calibration.json and CAMERA.yaml of each camera");
    }
    if (!o.dbc.empty()) {
        if (auto made = make_folder_of(o.dbc); !made) return made.error();
        if (auto written = save_dbc((*world)->scene(), o.dbc); !written) return written.error();
        say("wrote " + o.dbc);
    }

    std::vector<Finding> findings = general_findings();
    for (Finding& f : clock_findings((*world)->scene().time)) findings.push_back(std::move(f));
    const std::size_t general = findings.size();
    if (auto tested = test_devices(o.devices, o.named, (*world)->scene(), findings); !tested) return tested.error();
    nlohmann::json machine = nlohmann::json::array();
    for (const Finding& f : findings) {
        say(fmt::format("  [{}] {}: {}{}", f.there ? "ok" : "--", f.name, f.detail,
                        f.remedy.empty() ? "" : "\n         try: " + f.remedy));
        machine.push_back({{"name", f.name}, {"there", f.there}, {"detail", f.detail}, {"remedy", f.remedy}});
    }
    document.update({{"scene", scene_document}, {"machine", machine}});
    for (std::size_t i = general; i < findings.size(); ++i) {  // devices named on the command line must exist
        if (findings[i].there) continue;
        const Error missing{findings[i].detail, findings[i].name, 0, 0, ErrorKind::missing, findings[i].remedy};
        say("narpa: " + missing.text());
        if (!document.contains("error")) document.update(to_json(missing));  // the first; `machine` has all
    }
    return document;
}

}  // namespace

Command add_check(Parser app) {
    auto o = std::make_shared<CheckOptions>();
    const Parser c = app.subcommand(
        "check", "Check a scene, scenario or recipe of a data set, and this machine; names what is missing");
    c.option("SCENE", o->scene.file, "Scene, scenario or recipe file (TOML), or a name that `narpa list` shows");
    o->scene.add_settings_to(c);
    c.option("DEVICE", o->devices,
             "Devices that the run will need, which are opened as a test: vcan0, slcan:PORT, usb:, /dev/video10, "
             "bulk: ... One that may be several things, such as udp:, needs its option");
    o->named.add_to(c);
    c.option(
         "--calibration", o->calibration,
         "Write CAMERA.yaml (camera_info of ROS) and calibration.json here: matrix, distortion and mount of each "
         "sensor")
        .type_name("DIR");
    c.option("--dbc", o->dbc, "Write the DBC of the scene's commanded bodies to this file").type_name("FILE");
    std::vector<std::string> schemas;
    for (const SchemaRow& row : kSchemas) schemas.push_back(row.name);
    c.option("--schema", o->schema, "Print the JSON schema of such files, for editors, and check nothing")
        .one_of(schemas);
    c.group("Start here");
    c.examples({"narpa check docking", "narpa check my-scene.toml vcan0 /dev/video10",
                "narpa check docking --can vcan0 --video nav=tcp:5000 --lidar top=udp:192.168.1.70:2368",
                "narpa check docking --dbc out/docking.dbc"});
    return [o] { return check(*o); };
}

}  // namespace narpa::cli
