/// renderer/scene_file/trajectory_bodies.h - `trajectory` of a body: it moves as a file says.
#pragma once

#include <map>
#include <memory>
#include <string>
#include <vector>

#include "renderer/scene_file/scene_parts.h"

namespace narpa {

/// The motions of one trajectory file (renderer/trajectory/trajectory.h).
struct TrajectoryMotions {
    std::vector<std::string> names;  ///< of its bodies, in the order of their first rows
    std::map<std::string, std::shared_ptr<const Course>, std::less<>> courses;
};

/// Reads each file once.
class TrajectoryFiles {
public:
    explicit TrajectoryFiles(SceneReading& reading) : reading_(reading) {}
    /// Null, with the problem noted, if the file that the table names cannot be read.
    const TrajectoryMotions* named_by(TableReader& body);

private:
    SceneReading& reading_;
    std::map<std::string, TrajectoryMotions> files_;
};

struct NamedCourse {
    std::string name;
    std::shared_ptr<const Course> course{};  ///< null: none
};

/// The bodies that a [[body]] stands for. Without `trajectory` it is the one of its name. With it, the motion is
/// the file's; a name that ends with `*` stands for all bodies of the file that begin so. Empty, with the problem
/// noted, where there is none.
std::vector<NamedCourse> read_named_courses(TableReader& body, TakenNames& taken, TrajectoryFiles& files);

}  // namespace narpa
