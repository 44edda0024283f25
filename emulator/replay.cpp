#include "emulator/replay.h"

#include <fmt/format.h>

#include <charconv>
#include <fstream>
#include <map>
#include <string_view>

#include "emulator/run_record.h"
#include "renderer/scene/scene_file.h"
#include "emulator/camera_unit.h"

namespace narpa {
namespace {

std::vector<std::string_view> cells_of(std::string_view line, char separator) {
    std::vector<std::string_view> cells;
    for (std::size_t start = 0;;) {
        const std::size_t end = std::min(line.find(separator, start), line.size());
        cells.push_back(line.substr(start, end - start));
        if (end == line.size()) return cells;
        start = end + 1;
    }
}

template <class Number>
bool read_number(std::string_view text, Number& value) {
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    return error == std::errc{} && end == text.data() + text.size();
}

/// The columns that matter here; `passes` is a list like 65536;131072, empty where there were none.
bool read_cell(std::string_view column, std::string_view text, LoggedFrame& frame) {
    if (column == "frame") return read_number(text, frame.frame);
    if (column == "t_exposure_mid_ns") return read_number(text, frame.t_mid_ns);
    if (column == "samples_per_pixel") {
        double mean = 0;
        if (!read_number(text, mean) || !(mean >= 0 && mean <= 65535)) return false;
        frame.spp = std::max(1, static_cast<int>(mean + 0.5));
        return true;
    }
    if (column == "expected_error") return read_number(text, frame.expected_error);
    if (column == "step") {
        int step = 0;
        if (!read_number(text, step) || step < 0 || step > static_cast<int>(FrameStep::nothing)) return false;
        frame.step = static_cast<FrameStep>(step);
        return true;
    }
    if (column != "passes" || text.empty()) return true;
    const auto passes = cells_of(text, ';');
    if (passes.size() > frame.passes.size()) return false;
    for (std::size_t i = 0; i < passes.size(); ++i)
        if (!read_number(passes[i], frame.passes[i])) return false;
    return true;
}

}  // namespace

Result<std::vector<LoggedFrame>> read_ledger_log(const std::string& path) {
    std::ifstream in(path);
    std::string header, line;
    if (!in || !std::getline(in, header)) return Error{"cannot be read, expected the ledger log of a camera", path};
    const std::vector<std::string_view> columns = cells_of(header, ',');
    for (const std::string_view needed : {"frame", "t_exposure_mid_ns"})
        if (std::find(columns.begin(), columns.end(), needed) == columns.end())
            return Error{fmt::format("has no column \"{}\", expected the ledger log of a camera", needed), path, 1,
                         1};
    std::vector<LoggedFrame> frames;
    for (int number = 2; std::getline(in, line); ++number) {
        const std::vector<std::string_view> cells = cells_of(line, ',');
        if (cells.size() != columns.size())
            return Error{fmt::format("{} columns, expected {}", cells.size(), columns.size()), path, number, 1};
        LoggedFrame frame;
        for (std::size_t i = 0; i < cells.size(); ++i)
            if (!read_cell(columns[i], cells[i], frame))
                return Error{fmt::format("\"{}\" cannot be a {}", cells[i], columns[i]), path, number,
                             static_cast<int>(cells[i].data() - line.data()) + 1};
        frames.push_back(frame);
    }
    return frames;
}

struct Replay::Impl {
    Impl(std::unique_ptr<World> w, std::size_t camera_index, RunRecord r)
        : world(std::move(w)),
          camera(world->scene().cameras[camera_index]),
          record(std::move(r)),
          placement(world->scene().bodies.size()),
          renderer(world->tracer(), camera),
          picture(camera.width, camera.height),
          reference(camera.width, camera.height) {}

    std::unique_ptr<World> world;
    const Camera& camera;
    RunRecord record;
    std::vector<LoggedFrame> frames;
    std::map<std::int64_t, std::vector<TrajectoryRow>> truth;  ///< by time
    Placement placement;
    CameraRenderer renderer;
    RadianceImage picture, reference;
    Aovs middles;
    Rigid3 T_world_camera{};
    std::uint32_t frame = 0;

    Status place(const LoggedFrame& logged);
    [[nodiscard]] FrameSettings settings() const;
};

Result<std::unique_ptr<Replay>> Replay::open(const std::string& folder, const std::string& camera,
                                             const std::string& scene_file) {
    auto record = read_run_record(folder);
    if (!record) return record.error();
    const std::string& file = scene_file.empty() ? record->scene_file : scene_file;
    auto scene = read_scene(file);
    if (!scene) return scene.error();
    if (auto good = use_method(*scene, record->render.method); !good) return good.error();
    scene->render = record->render;
    auto index = sensor_named(scene->cameras, camera, "camera", scene->file);
    if (!index) return index.error();
    const std::string stem = folder + "/" + scene->cameras[*index].name;
    auto frames = read_ledger_log(stem + ".ledger.csv");
    if (!frames) return frames.error();
    auto truth = read_trajectory(stem + ".truth.csv");
    if (!truth) return truth.error();
    auto world = World::create(*std::move(scene));
    if (!world) return world.error();
    auto impl = std::make_unique<Impl>(*std::move(world), *index, *std::move(record));
    impl->frames = *std::move(frames);
    for (TrajectoryRow& row : *truth) impl->truth[row.t_ns].push_back(std::move(row));
    return std::unique_ptr<Replay>(new Replay(std::move(impl)));
}

Replay::Replay(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
Replay::~Replay() = default;

const std::vector<LoggedFrame>& Replay::frames() const noexcept {
    return impl_->frames;
}
const World& Replay::world() const noexcept {
    return *impl_->world;
}
const Camera& Replay::camera() const noexcept {
    return impl_->camera;
}

/// Every body where the log says that it was.
Status Replay::Impl::place(const LoggedFrame& logged) {
    const auto rows = truth.find(logged.t_mid_ns);
    if (rows == truth.end())
        return Error{fmt::format("frame {} has no row in the truth log at {} ns", logged.frame, logged.t_mid_ns)};
    if (auto loaded = world->load(rows->second, logged.t_mid_ns, logged.t_mid_ns); !loaded) return loaded.error();
    (void)world->place(logged.t_mid_ns, camera.mount, placement);
    T_world_camera = world->sensor_pose(camera.mount, camera.T_mount_camera, placement);
    frame = logged.frame;
    return Ok{};
}

FrameSettings Replay::Impl::settings() const {
    FrameSettings s;
    s.seed = record.render.seed;
    s.frame = frame;
    s.method = record.render.method;
    s.max_depth = record.render.max_depth;
    return s;
}

Status Replay::make(std::size_t i) {
    const LoggedFrame& logged = impl_->frames[i];
    if (auto placed = impl_->place(logged); !placed) return placed.error();
    FrameSettings settings = impl_->settings();
    settings.spp = logged.spp;
    if (impl_->record.render.budget_ns > 0 || impl_->record.render.budget_rays > 0) {
        settings.budget.kind = FrameBudget::Kind::passes;
        settings.budget.passes = logged.passes;
        settings.budget.step = static_cast<std::uint8_t>(logged.step);
    }
    impl_->renderer.render(impl_->placement, impl_->T_world_camera, settings, impl_->picture);
    return Ok{};
}

const RadianceImage& Replay::picture() const noexcept {
    return impl_->picture;
}

ImageDifference Replay::against(int spp) {
    FrameSettings settings = impl_->settings();
    settings.spp = spp;
    settings.seed = ~settings.seed;
    impl_->renderer.render(impl_->placement, impl_->T_world_camera, settings, impl_->reference, &impl_->middles);
    return compare(impl_->picture, impl_->reference, impl_->middles.body, full_scale_radiance(impl_->camera));
}

}  // namespace narpa
