#!/usr/bin/python3
"""Writes mission.c, the flight computer's table of a scenario, from the folder of a rehearsal of it.

Usage: mission_table.py out/rehearsal/dispersions > mission.c

The flight computer docks along the V-bar with one camera without distortion, by lamps; anything else is an error.
"""
import math
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "python"))
from narpa.logs import Run  # noqa: E402


def need(condition, what):
    if not condition:
        sys.exit(f"mission_table.py: {what}")


def numbers(values):
    return "{" + ", ".join(repr(float(v)) for v in values) + "}"


def radians(values_deg):
    return [math.radians(v) for v in values_deg]


def table(run):
    scenario, calibration = run.scenario(), run.calibration()
    orbit, start, chaser, thrusters = (scenario[k] for k in ("orbit", "start", "chaser", "thrusters"))
    tracker, control, navigation = scenario["attitude_sensor"], scenario["control"], scenario["navigation"]
    cameras = navigation["cameras"]
    need(len(cameras) == 1, f"expected a scenario with one camera, it has {len(cameras)}")
    camera = calibration[cameras[0]]
    need(camera["format"] == "GREY", f"expected a camera with GREY frames, got {camera['format']}")
    need("camera_matrix" in camera.entries, "expected a pinhole camera")
    need(not camera.distortion.any(), "expected a camera without distortion")
    policies = [c.get("late_policy", "late") for c in run.scene()["camera"] if c["name"] == camera.name]
    need(policies in (["late"], ["drop"]), f"expected late_policy \"late\" or \"drop\", got {policies}: a repeated frame has another time")
    need(camera.mount == chaser["body"], f"expected a camera on {chaser['body']}, it is on {camera.mount}")
    need(orbit["model"] != "surface" and list(orbit["up"]) == [0, 0, 1] and list(orbit["along"]) == [1, 0, 0],
         "expected an orbit with up = [0, 0, 1] and along = [1, 0, 0]")
    for body in ("target", "chaser"):
        need("port" not in scenario[body], f"expected the port of the {body} at the origin of its axes")
    need(scenario["target"].get("with_lvlh", True), "expected a target that keeps its attitude in LVLH")
    need(all("to_m" in leg and not leg.get("look_at_target", False) for leg in scenario["leg"]), "expected straight legs")
    lamps = [m for m in run.marks(scenario["target"]["body"]) if m.kind == "lamp"]
    need(len(lamps) >= 8, f"expected at least 8 lamps on the target, it has {len(lamps)}")
    index = [name for name, sensor in calibration.items() if "width" in sensor.entries].index(camera.name)
    still = [0.0, 0.0, 0.0]
    (fx, _, cx), (_, fy, cy), _ = camera.matrix.tolist()

    yield f'    .scenario = "{scenario["scenario"]["name"]}",'
    yield f'    .camera = {{.name = "{camera.name}", .index = {index}, .width = {camera["width"]}, .height = {camera["height"]},'
    yield f'               .rate_hz = {camera["rate_hz"]!r}, .fx = {fx!r}, .fy = {fy!r}, .cx = {cx!r}, .cy = {cy!r},'
    yield f"               .position_m = {numbers(camera.position_m)}, .q_CK = {numbers(camera.attitude)}}},"
    yield f"    .lamps = {len(lamps)},"
    yield "    .lamp = {"
    for m in lamps:
        yield f"        {{{numbers(m.position_m)}, {m['radius_m']!r}}}, /* {m.name} */"
    yield "    },"
    yield f"    .legs = {len(scenario['leg'])},"
    yield "    .leg = {"
    for leg in scenario["leg"]:
        within = leg.get("within_m", math.inf)
        yield (f"        {{.to_m = {numbers(leg['to_m'])}, .speed_m_s = {leg['speed_m_s']!r}, .hold_s = {leg.get('hold_s', 0.0)!r}, "
               f".within_m = {within if math.isfinite(within) else 1e9!r}, .contact = {str(leg.get('contact', False)).lower()}}}, "
               f"/* {leg['name']} */")
    yield "    },"
    yield f"    .period_s = {navigation['period_s']!r},"
    yield f"    .orbit_rate_rad_s = {math.sqrt(orbit.get('mu_m3_s2', 3.986004418e14) / orbit['radius_m'] ** 3)!r},"
    yield f"    .start_m = {numbers(start['position_m'])},"
    yield f"    .start_sigma_m = {numbers(start.get('position_sigma_m', still))},"
    yield f"    .start_velocity_sigma_m_s = {numbers(start.get('velocity_sigma_m_s', still))},"
    yield f"    .start_attitude_sigma_rad = {numbers(radians(start.get('attitude_sigma_deg', still)))},"
    yield f"    .mass_kg = {float(chaser['mass_kg'])!r},"
    yield f"    .inertia_kg_m2 = {numbers(chaser['inertia_kg_m2'])},"
    yield f"    .centre_of_mass_m = {numbers(chaser['centre_of_mass_m'])},"
    yield f"    .force_n = {thrusters['force_n']!r}, .torque_n_m = {thrusters['torque_n_m']!r}, .min_on_s = {thrusters['min_on_s']!r},"
    yield f"    .tracker_sigma_rad = {math.radians(tracker['attitude_sigma_deg'])!r},"
    yield f"    .bandwidth_rad_s = {control['bandwidth_rad_s']!r},"
    yield f"    .attitude_bandwidth_rad_s = {control['attitude_bandwidth_rad_s']!r},"
    yield f"    .damping = {control.get('damping', 0.9)!r},"
    yield f"    .abort_sigma_m = {navigation.get('abort_sigma_m', 2.0)!r},"
    yield f"    .abort_lost_s = {navigation.get('abort_lost_s', 20.0)!r},"
    yield f"    .abort_off_m = {navigation.get('abort_off_m', 5.0)!r},"
    yield f"    .retreat_m_s = {control.get('retreat_m_s', 0.3)!r},"


def main():
    if len(sys.argv) != 2:
        sys.exit(__doc__.split("\n\n")[1])
    try:
        lines = list(table(Run(sys.argv[1])))
    except (OSError, ValueError, KeyError) as error:
        sys.exit(f"mission_table.py: {error!r}" if isinstance(error, KeyError) else f"mission_table.py: {error}")
    print("/* The scenario that is flown: written by mission_table.py from a rehearsal's folder. */")
    print('#include "mission.h"\n\nconst struct mission mission = {')
    print("\n".join(lines))
    print("};")


if __name__ == "__main__":
    main()
