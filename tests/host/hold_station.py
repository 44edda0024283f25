#!/usr/bin/python3
"""A closed loop with a navigation other than narpa's own: `narpa run` renders, narpa-dynamics flies, and
examples/navigation.py holds station for a minute. The errors are computed from the pose commands in narpa's CAN log.

Usage: hold_station.py [--real-time]"""
import math
import os
import subprocess
import sys
from pathlib import Path

import support
from support import expect

try:
    import can, cv2, numpy as np, serial  # noqa: F401: needed by the example
except ImportError as error:
    support.skip(f"{error} (python3-can, python3-opencv, python3-serial)")
from narpa import rotation
from narpa.can import Catalogue, Decoder

BUILD, SOURCE = Path(os.environ["NARPA_BUILD_DIR"]), Path(__file__).resolve().parents[2]
SCENES = BUILD / "scenes/rehearsal"
CHASER, TARGET = 0x100, 0x110
SECONDS, DRIFT_M, ATTITUDE_DEG = 60, 0.5, 2.0
LOCKSTEP = "--real-time" not in sys.argv

SCENARIO = f"""
[scenario]
based_on = "{SCENES}/docking.toml"
name = "hold"
scene = "{SCENES}/scene.toml"
duration_s = {SECONDS}.0
pose_rate_hz = 5.0

[navigation]
lidars = []
"""


def poses(log):
    """{can_id: {time: pose}} of the complete pose commands in a candump log."""
    decoder, found = Decoder(Catalogue()), {CHASER: {}, TARGET: {}}
    for line in log.read_text().splitlines():
        identifier, _, data = line.split()[2].partition("#")
        pose = decoder.accept(int(identifier, 16), bytes.fromhex(data)) if not data.startswith("#") else None
        if pose and pose.name == "Pose" and pose.base in found:
            found[pose.base][pose["Time"]] = pose
    return found


def beside(target, chaser):
    """Position and attitude of the chaser in the target's axes."""
    to_target = rotation.conjugate(target.quaternion())
    away = np.subtract(chaser.vector("Position"), target.vector("Position"))
    return rotation.rotate(to_target, away), rotation.product(to_target, chaser.quaternion())


def start(folder, name, command):
    output = open(folder / name, "wb")
    return subprocess.Popen([str(c) for c in command], stdout=output, stderr=subprocess.STDOUT)


def await_line(run, path, word):
    for _ in range(600):
        if word in path.read_text(errors="replace"):
            return
        run.expect_alive()
        support.time.sleep(0.1)
    expect(False, f"{path.name} says {word}")


def fly(folder):
    """Returns the output of the navigation."""
    fifo, scenario = folder / "nav", folder / "hold.toml"
    os.mkfifo(fifo)
    scenario.write_text(SCENARIO)
    mode = ["--lockstep"] if LOCKSTEP else []
    with support.Run(SCENES / "scene.toml", "--can", "slcan:0", "--video", f"nav={fifo}", "--log", folder / "emulator",
                     *mode) as run:
        port = run.wait_for(r"commands: slcan: 127\.0\.0\.1:(\d+) ")[1]
        navigation = start(folder, "navigation.out", [sys.executable, SOURCE / "examples/navigation.py",
                                                      f"slcan:{port}", fifo])
        try:
            await_line(run, folder / "navigation.out", "ready")
            dynamics = start(folder, "dynamics.out", [BUILD / "bin/narpa-dynamics", scenario, "--can", f"slcan:{port}",
                                                      "--patience", "60", *mode])
            ended = dynamics.wait(timeout=1500)
            output = (folder / "navigation.out").read_text()
            if ended != 0:
                print((folder / "dynamics.out").read_text(), output)
            expect(ended == 0, "narpa-dynamics flies to the end")
            expect(navigation.wait(timeout=300) == 0, "examples/navigation.py ends with it")
        finally:
            navigation.kill()
        summary = run.stop()
    [sink] = summary["cameras"][0]["sinks"]
    expect(sink["written"] > 0.9 * SECONDS, f"frames were read: {sink}")
    return (folder / "navigation.out").read_text()


folder = support.work_folder()
output = fly(folder)
found = poses(folder / "emulator/can.log")
target, chaser = found[TARGET], found[CHASER]
track = [beside(target[t], chaser[t]) for t in sorted(chaser) if t in target]
expect(len(track) > 4.5 * SECONDS, f"{len(track)} poses of both bodies on CAN")
drift_m = max(math.dist(p, track[0][0]) for p, _ in track)
turn_deg = max(math.degrees(rotation.angle(q, track[0][1])) for _, q in track)
if drift_m >= DRIFT_M or turn_deg >= ATTITUDE_DEG:
    print(output)
expect(drift_m < DRIFT_M, f"the chaser drifts by {drift_m:.3f} m, less than {DRIFT_M} m")
expect(turn_deg < ATTITUDE_DEG, f"it turns by {turn_deg:.2f} degrees, less than {ATTITUDE_DEG}")
