#!/usr/bin/python3
"""In the virtual machine: one pulse per second on a GPIO line, a wire to another line, and exposures by its edges: each the camera's
latency after the edge, and each edge at a whole UTC second. Then the pulses on RTS of the serial port."""
import array
import csv
import fcntl
import json
import os
import subprocess
import sys
import termios
import threading
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "host"))
import support
from support import expect

SECOND_NS, LATENCY_NS, HIGH_NS = 1_000_000_000, 20_000_000, 100_000_000
SCENE = """
[time]
source = "system"
[sun]
direction = [-1, 0.5, 0.7]
[[body]]
name = "target"
sphere = {radius_m = 2}
[[camera]]
name = "nav"
position_m = [-10, 0, 0]
attitude_wxyz = [0.5, -0.5, 0.5, -0.5]
resolution = [64, 48]
fov_horizontal_deg = 40
rate_hz = 2
detector = {exposure_s = 0.001}
control = {trigger = "external", latency_s = 0.02}
"""
folder = support.work_folder()
(folder / "scene.toml").write_text(SCENE)


def run(name, *options):
    """Report and ledger of a run of a few seconds."""
    log = folder / name
    done = subprocess.run([support.NARPA, "run", folder / "scene.toml", "--can", "vcan0", "--video", "nav=none", "--threads", "1", "--log", log,
                           "--duration", "6", "--json", *options], capture_output=True, text=True)  # fmt: skip
    if done.returncode != 0:
        print(done.stderr)
    expect(done.returncode == 0, f"{name}: the run ends well")
    with open(log / "nav.ledger.csv") as f:
        return json.loads(done.stdout), list(csv.DictReader(f))


def check_edges(name, edge_ns, *options):
    report, rows = run(name, "--pps", "gpio:gpiochip0/0", "--trigger", f"gpio:/dev/gpiochip0/1{',falling' if edge_ns else ''}", *options)
    pulses, (trigger,) = report["second_pulses"], report["triggers"]
    print(name, pulses, trigger)
    expect(pulses["pulses"] >= 4 and pulses["failed"] == 0, f"{name}: pulses, one a second")
    expect(trigger["pulses_lost"] == 0 and abs(trigger["pulses_received"] - pulses["pulses"]) <= 1, f"{name}: each has its edge")
    expect(len(rows) >= 3, f"{name}: frames, {len(rows)}")
    seconds, late_ns, taken_ns = [], [], []
    for row in rows:
        t_ns = int(row["t_trigger_ns"])
        utc_ns = int(row["utc_offset_ns"]) + t_ns - edge_ns
        seconds.append(utc_ns // SECOND_NS)
        late_ns.append(utc_ns % SECOND_NS)
        taken_ns.append(int(row["t_trigger_taken_ns"]) - t_ns)
        expect(row["trigger"] == "external" and int(row["t_exposure_start_ns"]) == t_ns + LATENCY_NS, f"{name}: exposed {LATENCY_NS} ns after its edge")
    expect(len(set(seconds)) == len(rows), f"{name}: a frame for each second")
    bound_ns = 1e3 * pulses["late_us"]["max"] + (HIGH_NS if edge_ns else 0)
    expect(max(late_ns) <= bound_ns, f"{name}: edges {min(late_ns)} to {max(late_ns)} ns after whole UTC seconds{' + 0.1 s' if edge_ns else ''}")
    expect(min(taken_ns) >= 0, f"{name}: edges are taken {min(taken_ns)} to {max(taken_ns)} ns after they came")


def check_serial(device):
    edges, ends = [], threading.Event()

    def watch():
        fd, before = os.open(device, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK), None
        while not ends.is_set():
            state = array.array("i", [0])
            fcntl.ioctl(fd, termios.TIOCMGET, state)
            high = bool(state[0] & termios.TIOCM_RTS)
            if high and before is False:
                edges.append(time.time())
            before = high
            time.sleep(0.001)
        os.close(fd)

    watcher = threading.Thread(target=watch)
    watcher.start()
    report, _ = run("serial", "--pps", f"serial:{device}")
    ends.set()
    watcher.join()
    pulses = report["second_pulses"]
    print("serial", pulses, [round(t % 1, 4) for t in edges])
    expect(pulses["pulses"] >= 4 and abs(len(edges) - pulses["pulses"]) <= 2, f"RTS rises once for each of {pulses['pulses']} pulses")
    expect(all(t % 1 < 0.5 for t in edges), "after whole UTC seconds")


lines = subprocess.run(["cat", "/sys/bus/gpio/devices/gpiochip0/uevent"], capture_output=True, text=True).stdout
expect("gpiochip0" in lines or Path("/dev/gpiochip0").exists(), "the rig has a GPIO chip")
check_edges("rising", 0)
check_edges("falling", HIGH_NS)
check_serial("/dev/ttyS0")
