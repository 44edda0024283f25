/// renderer/trace/lights.h - the emitters of a scene: Sun, lights, surfaces that shine by themselves.
#pragma once

#include "renderer/trace/tracer.h"

namespace narpa {

class Lights {
public:
    explicit Lights(const Scene& scene);

    /// Is there anything beside the Sun's disc and the ambient? What the quick direct path leaves out.
    [[nodiscard]] bool beyond_the_sun() const noexcept;
};

}  // namespace narpa
