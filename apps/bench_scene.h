/// apps/bench_scene.h - the scenes that the benches look at.
#pragma once

#include <string>

#include "base/result.h"
#include "renderer/scene/scene.h"

namespace narpa::cli {

/// Where the scenes lie that narpa brings along: beside the folder of the program, in a build and when installed.
[[nodiscard]] Result<std::string> shipped_scene(const std::string& name);

/// The same view with other pixels.
void resize(Camera& camera, int width, int height);
/// The same view, its longer side so many pixels.
void resize_longer_side(Camera& camera, int pixels);

/// A line on a terminal that replaces itself; nothing elsewhere.
class Progress {
public:
    Progress();
    ~Progress();
    Progress(const Progress&) = delete;
    Progress& operator=(const Progress&) = delete;
    void tell(const std::string& text) const;

private:
    bool terminal_;
};

}  // namespace narpa::cli
