"""The last 0.3 m of a docking with small frames, for the tests in the virtual machine."""
import os
import re
from pathlib import Path

from support import expect

SCENES = Path(os.environ["NARPA_BUILD_DIR"]) / "scenes"

SCENARIO = """
[scenario]
based_on = "{scenes}/rehearsal/docking-camera.toml"
name = "kernel"
title = "The last 0.3 m, on kernel devices"
scene = "scene.toml"
duration_s = 120.0
pose_rate_hz = 5.0

[start]
position_m = [0.3, 0.02, -0.02]
position_sigma_m = [0.02, 0.01, 0.01]
velocity_sigma_m_s = [0.002, 0.002, 0.002]
attitude_sigma_deg = [0.2, 0.2, 0.2]
rate_sigma_deg_s = [0.005, 0.005, 0.005]

[[leg]]
name = "contact"
to_m = [0.0, 0.0, 0.0]
speed_m_s = 0.075
contact = true
"""


def write_port(folder):
    """The station's faces within 1.5 m of its port: all that the camera sees. An emulated processor takes minutes to read and
    sort the whole mesh in each process."""
    docking = SCENES / "docking"
    (folder / "station.mtl").write_text(re.sub(r"^map_Kd ", f"map_Kd {docking}/", (docking / "station.mtl").read_text(), flags=re.M))
    near = [False]  # vertices, from 1 on
    with open(docking / "station.obj") as mesh, open(folder / "port.obj", "w") as port:
        for line in mesh:
            if line.startswith("v "):
                near.append(sum(float(x) ** 2 for x in line.split()[1:4]) < 1.5**2)
            elif line.startswith("f ") and not all(near[int(corner.split("/")[0])] for corner in line.split()[1:]):
                continue
            port.write(line)
    expect(sum(near) > 1000, "the port has more than 1000 vertices")


def small_scene():
    """The rehearsals' scene with small frames and the station's port alone."""
    text = (SCENES / "rehearsal/scene.toml").read_text()
    text, changed = re.subn(r"^resolution = .*", "resolution = [160, 120]", text, flags=re.M)
    expect(changed == 1, "the scene has one camera, now with 160 x 120 pixels")
    text, changed = re.subn(r'"../docking/station.obj"', '"port.obj"', text)
    expect(changed == 1, "the scene has one station")
    return text.replace('"../docking/', f'"{SCENES}/docking/')


def write(folder):
    """Writes scene and scenario there; returns the scenario's file."""
    write_port(folder)
    (folder / "scene.toml").write_text(small_scene())
    scenario = folder / "kernel.toml"
    scenario.write_text(SCENARIO.format(scenes=SCENES))
    return scenario
