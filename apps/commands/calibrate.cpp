// narpa calibrate - focal lengths, principal point and distortion of a camera from images of a target.
#include <fmt/format.h>

#include <cmath>
#include <memory>
#include <optional>

#include "apps/cli.h"
#include "apps/commands/estimate_batch.h"
#include "apps/outputs.h"
#include "apps/scene_argument.h"
#include "apps/scene_options.h"
#include "apps/warnings.h"
#include "base/write_file.h"
#include "emulator/threads.h"
#include "renderer/assets/calibration_file.h"
#include "tracking/calibration_report.h"

namespace narpa::cli {
namespace {

struct CalibrateOptions {
    SceneArgument scene;
    std::vector<std::string> images;
    std::string camera, target, unknowns, out;
    std::string method{camera_methods().front().name};
    PoseOptions pose;
    double time_s = 0, every_s = 1;
    int spp = 4, threads = 0;
    std::uint64_t seed = 1;
};

/// Files of a calibration.
struct CalibrationOutputs {
    std::string camera, report, images, picture;

    CalibrationOutputs(const std::string& folder, const std::string& name)
        : camera(folder + "/" + name + ".yaml"),
          report(folder + "/" + name + ".calibration.json"),
          images(folder + "/" + name + ".images.csv"),
          picture(folder + "/" + name + ".residuals.png") {}
    [[nodiscard]] std::vector<std::string> all() const {
        return {camera, report, images, picture, document_beside(picture)};
    }
};

/// The images with the bodies at their times.
Result<std::vector<CalibrationImage>> read_images(const CalibrateOptions& o, World& world, const Camera& camera) {
    const auto rows = o.pose.rows();
    if (!rows) return rows.error();
    std::vector<CalibrationImage> images;
    for (std::size_t i = 0; i < o.images.size(); ++i) {
        const auto bytes = load_frame(o.images[i], camera);
        if (!bytes) return bytes.error();
        auto image = measured_image(camera, *bytes);
        if (!image) return Error{image.error().what, o.images[i]};
        const std::int64_t t_ns = std::llround(1e9 * (o.time_s + static_cast<double>(i) * o.every_s));
        if (auto loaded = o.pose.load(world, *rows, t_ns, t_ns); !loaded) return loaded.error();
        BodyPoses at(world.scene().bodies.size());
        world.place(t_ns, camera.mount, at);
        images.push_back({o.images[i], *std::move(image), at});
    }
    return images;
}

Status write(const CalibrationOutputs& files, const std::string& scene, const Camera& camera,
             const CameraCalibration& found, const nlohmann::json& document) {
    const auto text = calibration_text(camera.name, {camera.width, camera.height, found.model});
    if (!text) return text.error();
    if (auto done = write_file(files.camera, *text); !done) return done;
    if (auto done = write_file(files.report, document.dump(2) + "\n"); !done) return done;
    if (auto done = write_file(files.images, calibration_rows(found)); !done) return done;
    return plot_calibration(files.picture, fmt::format("{}: camera {}", scene, camera.name), camera.width,
                            camera.height, found);
}

Outcome calibrate(const CalibrateOptions& o) {
    auto scene = o.scene.load();
    if (!scene) return scene.error();
    const auto index = sensor_named(scene->cameras, o.camera, "camera", scene->file);
    if (!index) return index.error();
    const CalibrationOutputs files(o.out, scene->cameras[*index].name);
    std::vector<std::string> inputs = o.images;
    inputs.push_back(o.pose.trajectory);
    if (auto kept = keep_inputs(files.all(), *scene, inputs); !kept) return kept.error();
    if (auto made = make_folder_of_picture(files.picture); !made) return made.error();
    if (auto placed = o.pose.place(*scene); !placed) return placed.error();
    auto world = World::create(*std::move(scene));
    if (!world) return world.error();
    const Camera& camera = (*world)->scene().cameras[*index];
    const auto target = target_of(**world, camera.mount, camera.name, o.target);
    if (!target) return target.error();
    CalibrationOptions options{
        .method = find_camera_method(o.method), .prior_sigma = {}, .seed = o.seed, .spp = o.spp};
    const BatchValues known = calibration_priors(camera);
    const auto priors =
        o.unknowns.empty() ? Result<BatchValues>(known) : batch_values(o.unknowns, "--unknowns", &known, false);
    if (!priors) return priors.error();
    options.prior_sigma = *priors;
    const auto images = read_images(o, **world, camera);
    if (!images) return images.error();
    TracingThreads threads(o.threads);
    std::optional<Result<CameraCalibration>> found;
    {
        const Progress progress(fmt::format("calibrating the camera from {} images", images->size()));
        threads.arena.execute([&] { found.emplace(calibrate_camera(**world, *index, *target, *images, options)); });
    }
    if (!*found) return found->error();
    const std::string name = (*world)->scene().file;
    say(fmt::format("camera {}: {}", camera.name, to_text(**found)));
    nlohmann::json document = to_json(**found);
    document["camera"] = camera.name, document["target"] = (*world)->scene().bodies[*target].name;
    document["method"] = o.method, document["file"] = files.camera;
    if (auto written = write(files, name, camera, **found, document); !written) return written.error();
    say("wrote " + files.camera + " and, beside it, the report, its images and residuals");
    return document;
}

}  // namespace

Command add_calibrate(Parser app) {
    auto o = std::make_shared<CalibrateOptions>();
    const Parser c = app.subcommand(
        "calibrate", "Calibrate a camera: focal lengths, centre and distortion from images of a target");
    o->scene.add_to(c);
    c.option("IMAGE", o->images, "Images, also of a real camera: as those of `estimate --frame`").required();
    c.option("-o,--output", o->out,
             "Folder for CAMERA.yaml, a calibration as OpenCV and ROS read it, CAMERA.calibration.json, "
             "CAMERA.images.csv and CAMERA.residuals.png")
        .type_name("DIR")
        .required();
    c.option("--camera", o->camera, "Name of the camera (default: the first)").type_name("NAME");
    c.option("--target", o->target,
             "Body in the images (default: the first with a mesh that does not carry the camera)")
        .type_name("BODY");
    std::vector<std::string> methods;
    for (const CameraMethod& m : camera_methods())
        if (m.finds_points) methods.emplace_back(m.name);
    c.option("--method", o->method, help_of_camera_methods()).one_of(methods).shows_default();
    o->pose.add_to(c);
    c.option("--time", o->time_s, "Time of the first image in the trajectory (default: 0)")
        .type_name("SECONDS")
        .range(-9e9, 9e9);
    c.option("--every", o->every_s, "Time in the trajectory from one image to the next (default: 1)")
        .type_name("SECONDS")
        .range(1e-3, 1e6);
    c.option("--unknowns", o->unknowns,
             "What is estimated, of focal, aspect, centre_px, k1, k2, p1, p2, k3, with standard deviations of the "
             "scene's values (default: all that the camera's projection has)")
        .type_name("NAME[=SIGMA],...");
    c.option("--spp", o->spp, "Samples per pixel of the renders").range(1, 4096).shows_default();
    c.option("--seed", o->seed, "Seed of the renders").shows_default();
    c.option("--threads", o->threads, "Threads (default: all cores)").range(0, 1024);
    c.footer("Exit status 1 if the camera still changed in the last round.");
    c.group("Results");
    c.examples({"narpa calibrate board.toml left*.png --trajectory starts.csv -o out/camera",
                "narpa calibrate marks frame*.png --method marks -o out/camera --unknowns focal,centre_px,k1"});
    return [o] { return calibrate(*o); };
}

}  // namespace narpa::cli
