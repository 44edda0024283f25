// The observer that `narpa run --estimate` gives a run.
#include <narpa/emulator/emulator.h>
#include <narpa/renderer/scene_file/scene_file.h>
#include <narpa/tracking/online_estimator.h>
#include <cstdio>
#include <string>

int main(int, char** argv) {
    auto scene = narpa::read_scene(argv[1] + std::string("/docking/docking.toml"));
    if (!scene) return std::puts(scene.error().text().c_str()), 2;
    narpa::RunOptions options;
    options.video = {{"nav", "none"}};
    options.observers = {narpa::estimate_from("nav", {})};
    auto emulator = narpa::Emulator::create(*std::move(scene), options);
    if (!emulator) return std::puts(emulator.error().text().c_str()), 2;
    return std::puts((*emulator)->observers().front()->observer().description().c_str()) < 0;
}
