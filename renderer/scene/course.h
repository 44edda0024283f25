/// renderer/scene/course.h - motion over simulation time of a body or camera that no command moves.
#pragma once

#include "base/pose.h"

namespace narpa {

class Course {
public:
    virtual ~Course() = default;
    /// In world; velocity and rate are the derivatives of the pose. Thread-safe; allocates nothing.
    [[nodiscard]] virtual Motion at(double t_s) const noexcept = 0;
};

}  // namespace narpa
