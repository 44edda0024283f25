/// apps/commands/check_machine.h - what a run may need from this machine, and whether it is there.
#pragma once

#include <string>
#include <vector>

#include "apps/device_options.h"
#include "base/result.h"
#include "renderer/scene/scene.h"

namespace narpa::cli {

/// One thing that a run may need from this machine.
struct Finding {
    std::string name;
    bool there = false;
    std::string detail, remedy;
};

/// What no option names: buses, devices, permissions.
[[nodiscard]] std::vector<Finding> general_findings();

/// The system's clock and ptp4l; empty where the scene does not take UTC from the system's clock.
[[nodiscard]] std::vector<Finding> clock_findings(const TimeSettings& time);

/// Tests the devices of the command line, by opening them; `devices`: those without an option. Errors: arguments
/// that name no device of the scene. A device that is missing is a finding.
[[nodiscard]] Status test_devices(const std::vector<std::string>& devices, const DeviceOptions& named,
                                  const Scene& scene, std::vector<Finding>& findings);

}  // namespace narpa::cli
