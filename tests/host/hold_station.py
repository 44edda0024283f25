#!/usr/bin/python3
"""A closed loop with a stranger in it: `narpa run` renders, narpa-dynamics flies, and examples/navigation.py, python-can
and OpenCV alone, holds station for a minute. How well is told by the pose commands in narpa's CAN log.

Usage: hold_station.py [--real-time]"""
import math
import os
import subprocess
import sys
from pathlib import Path

import support
from support import expect

try:
    import can, cv2, serial  # noqa: F401: what the example needs
except ImportError as error:
    support.skip(f"{error} (python3-can, python3-opencv, python3-serial)")

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


def signed(data, bits):
    value = int.from_bytes(data, "little") % 2**bits
    return value - 2**bits if value >= 2 ** (bits - 1) else value


def poses(log, base):
    """{time: (position, attitude)} of the whole classic pose commands of a body in a candump log."""
    whole, parts = {}, {}
    for line in log.read_text().splitlines():
        identifier, _, data = line.split()[2].partition("#")
        offset, data = int(identifier, 16) - base, bytes.fromhex(data)
        if not 0 <= offset <= 8:
            continue
        parts[offset] = data
        if offset == 8 and len({d[6] for d in parts.values()}) == 1 and len(parts) == 9:
            position = [signed(parts[k][:6], 48) * 1e-6 for k in (1, 2, 3)]
            q = [signed(parts[k][i : i + 3], 24) * 2**-22 for k in (4, 5) for i in (0, 3)]
            whole[int.from_bytes(parts[0][:6], "little")] = position, q
    return whole


def product(a, b):
    w, x, y, z = a
    return (w * b[0] - x * b[1] - y * b[2] - z * b[3], w * b[1] + x * b[0] + y * b[3] - z * b[2],
            w * b[2] - x * b[3] + y * b[0] + z * b[1], w * b[3] + x * b[2] - y * b[1] + z * b[0])


def conjugate(q):
    return q[0], -q[1], -q[2], -q[3]


def beside(target, chaser):
    """The chaser in the target's axes: position, attitude."""
    away = [c - t for c, t in zip(chaser[0], target[0])]
    to_target = conjugate(target[1])
    return product(product(to_target, (0, *away)), target[1])[1:], product(to_target, chaser[1])


def angle_deg(a, b):
    w, *axis = product(conjugate(a), b)
    return math.degrees(2 * math.atan2(math.hypot(*axis), abs(w)))


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
    """Returns what the navigation said."""
    fifo, scenario = folder / "nav", folder / "hold.toml"
    os.mkfifo(fifo)
    scenario.write_text(SCENARIO)
    mode = ["--lockstep"] if LOCKSTEP else []
    with support.Run(SCENES / "scene.toml", "--can", "slcan:0", "--video", f"nav={fifo}", "--log", folder / "emulator",
                     *mode) as run:
        port = run.wait_for(r"commands: slcan: 127\.0\.0\.1:(\d+) ")[1]
        navigation = start(folder, "navigation.out", [sys.executable, SOURCE / "examples/navigation.py",
                                                      f"socket://127.0.0.1:{port}", fifo])
        try:
            await_line(run, folder / "navigation.out", "ready")
            dynamics = start(folder, "dynamics.out", [BUILD / "bin/narpa-dynamics", scenario, "--can", f"slcan:{port}",
                                                      "--patience", "60", *mode])
            ended = dynamics.wait(timeout=150)
            said = (folder / "navigation.out").read_text()
            if ended != 0:
                print((folder / "dynamics.out").read_text(), said)
            expect(ended == 0, "narpa-dynamics flies to the end")
            expect(navigation.wait(timeout=30) == 0, "examples/navigation.py ends with it")
        finally:
            navigation.kill()
        summary = run.stop()
    [sink] = summary["cameras"][0]["sinks"]
    expect(sink["written"] > 0.9 * SECONDS, f"frames were read: {sink}")
    return (folder / "navigation.out").read_text()


folder = support.work_folder()
said = fly(folder)
log = folder / "emulator/can.log"
target, chaser = poses(log, TARGET), poses(log, CHASER)
track = [beside(target[t], chaser[t]) for t in sorted(chaser) if t in target]
expect(len(track) > 4.5 * SECONDS, f"{len(track)} poses of both bodies on CAN")
drift_m = max(math.dist(p, track[0][0]) for p, _ in track)
turn_deg = max(angle_deg(q, track[0][1]) for _, q in track)
if drift_m >= DRIFT_M or turn_deg >= ATTITUDE_DEG:
    print(said)
expect(drift_m < DRIFT_M, f"the chaser drifts by {drift_m:.3f} m, less than {DRIFT_M} m")
expect(turn_deg < ATTITUDE_DEG, f"it turns by {turn_deg:.2f} degrees, less than {ATTITUDE_DEG}")
