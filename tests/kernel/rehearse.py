#!/usr/bin/python3
"""In the virtual machine: the last 0.3 m of a docking with kernel devices, in lockstep and with small frames. The bus is CAN FD on
vcan0; the navigation's only sensor is a USB camera, driven by the kernel's uvcvideo. The chaser docks and passes every gate.

Usage: rehearse.py [BUS]   (outside the rig: rehearse.py slcan:0, with a FIFO in the camera's place)"""
import json
import os
import re
import subprocess
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "host"))
import support
import usb_devices
from support import expect

SCENES = Path(os.environ["NARPA_BUILD_DIR"]) / "scenes"
NAVIGATION = Path(support.NARPA).with_name("narpa-navigation")
os.environ["NARPA_PLOT"] = "true"  # no charts: an emulated processor takes minutes for matplotlib
BUS = sys.argv[1] if sys.argv[1:] else "vcan0"
CAMERA_PORT = 3241

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


def start_navigation(log):
    """Attaches the emulated camera and starts the navigation when `narpa rehearse` asks for it. The navigation streams before
    the first frame is rendered."""
    wait_until = usb_devices.wait_until
    wait_until("narpa rehearse asks for the navigation", lambda: "LOG=" in log.read_text(), 240)
    told = dict(re.findall(r"^  (\w+)=(.*)$", log.read_text(), flags=re.M))
    usb_devices.attach(CAMERA_PORT)
    wait_until("uvcvideo has the camera", usb_devices.usb_camera)
    command = [NAVIGATION, told["SCENARIO"], "--can", told["BUS"], "--video", f"nav={usb_devices.usb_camera()}", "--lockstep",
               "--seed", told["SEED"], "--threads", "2", "--log", folder / "navigation"]  # fmt: skip
    with open(folder / "navigation.out", "w") as out, open(folder / "navigation.err", "w") as err:
        navigation = subprocess.Popen([str(c) for c in command], stdout=out, stderr=err)
    wait_until("the navigation is ready", lambda: navigation.poll() is not None or "ready" in (folder / "navigation.out").read_text(), 240)
    return navigation


folder = support.work_folder()
write_port(folder)
(folder / "scene.toml").write_text(small_scene())
(folder / "kernel.toml").write_text(SCENARIO.format(scenes=SCENES))
command = [support.NARPA, "rehearse", folder / "kernel.toml", "-o", folder / "out", "--can", BUS, "--threads", "2",
           "--patience", "300", "--json"]
on_usb = BUS == "vcan0"
if on_usb:
    command += ["--video", f"nav=uvc:{CAMERA_PORT}", "--navigation", "none"]
log = folder / "rehearse.err"
rehearsal = subprocess.Popen([str(c) for c in command], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=open(log, "w"), text=True)
navigation = start_navigation(log) if on_usb else None
out, _ = rehearsal.communicate("\n" if on_usb else None)  # Enter confirms that the navigation is listening
if rehearsal.returncode != 0:
    print(out)
    for log in sorted(folder.rglob("*.log")) + sorted(folder.rglob("*.err")):
        print(f"--- {log}\n{log.read_text(errors='replace')[-2000:]}")
expect(rehearsal.returncode == 0, f"narpa rehearse on {BUS} exits with 0 (it did with {rehearsal.returncode})")
verdict = json.loads(out)
contact = {c["name"]: f"{c['value']:.4f} {c['unit']}" for c in verdict["contact"]["conditions"]}
expect(verdict["contact"]["captured"], f"captured: {contact}")
expect(verdict["bus"]["refused"] == 0, f"nothing on the bus was refused: {verdict['bus']}")
if on_usb:
    expect(navigation.wait(60) == 0, "the navigation ends well")
    n = json.loads((folder / "navigation/navigation.json").read_text())
    taken = n["sensors"]["nav"]["taken"]
    expect(n["frames_missing"] == 0 and n["frames"] == n["cycles"] == taken > 5, f"each of {n['cycles']} cycles had its frame, by USB alone")
