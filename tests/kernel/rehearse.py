#!/usr/bin/python3
"""In the rig: the last 0.3 m of a docking on real kernel devices: CAN FD on vcan0, frames through /dev/video10, LiDAR packets
over UDP; in lockstep, with small frames. It docks and passes every gate.

Usage: rehearse.py [BUS [CAMERA=DEVICE]]   (outside the rig: rehearse.py slcan:0)"""
import json
import os
import re
import subprocess
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "host"))
import support
from support import expect

SCENES = Path(os.environ["NARPA_BUILD_DIR"]) / "scenes"
os.environ["NARPA_PLOT"] = "true"  # no charts: an emulated processor takes minutes for matplotlib
DEVICES = sys.argv[1:] or ["vcan0", "nav=/dev/video10"]

SCENARIO = """
[scenario]
based_on = "{scenes}/rehearsal/docking.toml"
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


def small_scene():
    """The rehearsals' scene with small frames. v4l2loopback keeps two that nobody has taken: one a control period is well."""
    text = (SCENES / "rehearsal/scene.toml").read_text().replace('"../docking/', f'"{SCENES}/docking/')
    text, changed = re.subn(r"^resolution = .*", "resolution = [160, 120]", text, flags=re.M)
    expect(changed == 1, "the scene has one camera, now with 160 x 120 pixels")
    return text


folder = support.work_folder()
(folder / "scene.toml").write_text(small_scene())
(folder / "kernel.toml").write_text(SCENARIO.format(scenes=SCENES))
command = [support.NARPA, "rehearse", folder / "kernel.toml", "-o", folder / "out", "--can", DEVICES[0], "--threads", "2",
           "--patience", "300", "--json"]
for device in DEVICES[1:]:
    command += ["--video", device]
done = subprocess.run([str(c) for c in command], stdout=subprocess.PIPE, text=True)
if done.returncode != 0:
    print(done.stdout)
    for log in sorted((folder / "out").rglob("*.log")) + sorted((folder / "out").rglob("*.err")):
        print(f"--- {log}\n{log.read_text(errors='replace')[-2000:]}")
expect(done.returncode == 0, f"narpa rehearse on {' '.join(DEVICES)} exits with 0 (it did with {done.returncode})")
verdict = json.loads(done.stdout)
contact = {c["name"]: f"{c['value']:.4f} {c['unit']}" for c in verdict["contact"]["conditions"]}
expect(verdict["contact"]["captured"], f"captured: {contact}")
expect(verdict["bus"]["refused"] == 0, f"nothing on the bus was refused: {verdict['bus']}")
