#!/usr/bin/python3
"""PCL's unmodified VLP and HDL grabbers decode the packets of a VLP-16 and an HDL-32E that move at 5 m/s and turn at 10
deg/s, live over UDP and from the captures of the same run. Every point of a complete sweep is within 3 mm
of the measured position; no point is missing or extra. Measured and ray-traced ranges differ by the scene's noise only.

PCL 1.13 (vlp_grabber.cpp, hdl_grabber.cpp) neglects three effects: the firing time of a laser within a sequence of 16 or
32 (all get the azimuth of the start of the sequence); the height at which a beam of a VLP-16 crosses the axis; fractions
of 0.01 deg. The first two are corrected here before points are compared; the third is 1 mm at 6 m, part of the 3 mm.
"""
import csv
import math
import os
import subprocess
import time
from pathlib import Path

import support
from support import expect

try:
    import can, serial  # noqa: F401: needed by support.open_bus
except ImportError as error:
    support.skip(f"{error} (python3-can, python3-serial)")

RECEIVER = Path(os.environ["NARPA_BUILD_DIR"]) / "bin/pcl_receiver"
SWEEP = 1  # counted from 0: between the second and the third passage of azimuth 0
TOLERANCE_M, NOISE_M = 0.003, 0.02
# Each command advances the flight by 10 ms: 8 packets of the VLP-16 and 18 of the HDL-32E. PCL's sockets buffer 92 packets,
# so PCL may pause for half a second.
PACE_S = 0.1
VELOCITY_M_S = (4.0, -0.5, 2.958)  # 5 m/s
RATE_RAD_S = [math.radians(10) * a for a in (0.48, 0.8, 0.36)]
# By model: number of lasers, and vertical corrections in metres (Velodyne, VLP-16 User Manual 63-9243 Rev. D, table 9-1).
LASERS = {"VLP-16": 16, "HDL-32E": 32}
CORRECTION_M = {
    "VLP-16": [h * 1e-3 for h in (11.2, -0.7, 9.7, -2.2, 8.1, -3.7, 6.6, -5.1, 5.1, -6.6, 3.7, -8.1, 2.2, -9.7, 0.7, -11.2)],
    "HDL-32E": [0.0] * 32,
}
LIDARS = {"top": "VLP-16", "side": "HDL-32E"}


def write_scene(folder):
    """The scene's LiDAR with noise, and an HDL-32E beside it."""
    for file in support.SCENE.parent.iterdir():
        (folder / file.name).write_bytes(file.read_bytes())
    noise = f"\nrange_noise_m = {NOISE_M}\nrange_min_m = 0.2\n"  # farther than the body that carries the LiDARs
    second = '[[lidar]]\nname = "side"\nmount = "chaser"\nposition_m = [0.05, 0.0, 0.0]\n'
    second += f'attitude_wxyz = [0.7071067811865476, 0.7071067811865476, 0, 0]\nmodel = "HDL-32E"\nrate_hz = 10{noise}\n[render]'
    head, lidar, tail = support.SCENE.read_text().partition('model = "VLP-16"\nrate_hz = 10')
    path = folder / "moving.toml"
    path.write_text(head + lidar + noise + tail.replace("[render]", second, 1))
    return path


def write_trajectory(path):
    """Writes motion so fast that the time of a shot within the sweep moves its hit by up to half a metre."""
    lines = ["t_s,body,x_m,y_m,z_m,qw,qx,qy,qz,vx_m_s,vy_m_s,vz_m_s,wx_rad_s,wy_rad_s,wz_rad_s"]
    rate = math.hypot(*RATE_RAD_S)
    for i in range(41):
        t = 0.01 * i
        position = [p + v * t for p, v in zip((-0.9, 0.1, -0.9), VELOCITY_M_S)]
        q = (math.cos(rate * t / 2), *(math.sin(rate * t / 2) * w / rate for w in RATE_RAD_S))
        numbers = (t, *position, *q, *VELOCITY_M_S, *RATE_RAD_S)
        lines.append(f"{numbers[0]!r},{support.BODY}," + ",".join(repr(v) for v in numbers[1:]))
    path.write_text("\n".join(lines) + "\n")


def fly(run, port, trajectory):
    wire = support.Wire()
    bus = support.open_bus(run, interface="slcan", channel=f"socket://127.0.0.1:{port}", sleep_after_open=0.1)
    with open(trajectory, newline="") as file:
        for i, row in enumerate(csv.DictReader(file)):
            t, *numbers = (float(value) for key, value in row.items() if key != "body")
            pose = support.Pose(numbers[0:3], numbers[3:7], numbers[7:10], numbers[10:13])
            for message in wire.command(pose, round(t * 1e9), i):
                bus.send(message)
            time.sleep(PACE_S)
    bus.shutdown()


def read_truth(scene, lidar, trajectory, folder):
    """Every shot of the first four turns in firing order, as dictionaries of numbers."""
    path = folder / f"{lidar}.csv"
    support.narpa("scan", scene, "--lidar", lidar, "--trajectory", trajectory, "--duration", 0.4, "-o", path)
    numbers = ("azimuth_rad", "elevation_rad", "range_m", "reported_range_m")
    with open(path, newline="") as file:
        return [{k: float(row[k]) for k in numbers} | {"laser": int(row["laser"])} for row in csv.DictReader(file)]


def split_as_pcl_does(truth, make):
    """Sweeps of hits with the azimuth (0.01 deg) that PCL uses. A sweep ends where this azimuth decreases."""
    sweeps, last, lasers = [[]], -1.0, LASERS[make]
    for at in range(0, len(truth) - 383, 384):
        packet = truth[at : at + 384]
        starts = [round(math.degrees(packet[32 * block]["azimuth_rad"]) * 100) % 36000 for block in range(12)]
        half = (starts[1] - starts[0]) % 36000 / 2
        for i, shot in enumerate(packet):
            azimuth = starts[i // 32] + (half if i % 32 >= lasers else 0)
            azimuth -= 36000 if azimuth > 36000 else 0
            # The VLP grabber ends a sweep at a shot with a return, the HDL grabber at any.
            hit = shot["reported_range_m"] > 0
            if make == "VLP-16" and not hit:
                continue
            if azimuth < last and sweeps[-1]:
                sweeps.append([])
            last = azimuth
            if hit:
                sweeps[-1].append((shot, int(azimuth), shot["azimuth_rad"] - packet[i - i % lasers]["azimuth_rad"]))
    return sweeps


def compare(points, truth_sweep, make, what):
    expect(len(points) == len(truth_sweep), f"{what}: {len(points)} points, {len(truth_sweep)} ray-traced hits")
    worst = 0.0
    for (x, y, z), (shot, azimuth_cdeg, into_sequence) in zip(points, truth_sweep):
        pcl_azimuth = math.atan2(x, y)
        off = math.remainder(pcl_azimuth - math.radians(azimuth_cdeg / 100), 2 * math.pi)
        if abs(off) > math.radians(1e-3):
            expect(False, f"{what}: PCL's azimuth {math.degrees(pcl_azimuth) % 360:.4f} deg, expected {azimuth_cdeg / 100} deg")
        horizontal, azimuth = math.hypot(x, y), pcl_azimuth + math.remainder(into_sequence, 2 * math.pi)
        height = CORRECTION_M[make][shot["laser"]]
        corrected = (horizontal * math.sin(azimuth), horizontal * math.cos(azimuth), z + height)
        r, a, w = shot["reported_range_m"], shot["azimuth_rad"], shot["elevation_rad"]
        measured = (r * math.cos(w) * math.sin(a), r * math.cos(w) * math.cos(a), r * math.sin(w) + height)
        worst = max(worst, math.dist(corrected, measured))
    expect(worst <= TOLERANCE_M, f"{what}: {len(points)} points, none missing or extra, the worst {worst * 1000:.2f} mm from its place")


def compare_noise(truth_sweep, what):
    """Compares measured ranges, which PCL decodes correctly (see compare), with the ray-traced ranges."""
    errors = [shot["reported_range_m"] - shot["range_m"] for shot, _, _ in truth_sweep]
    mean, n = sum(errors) / len(errors), len(errors)
    deviation = math.sqrt(sum((e - mean) ** 2 for e in errors) / n)
    expect(abs(mean) < 4 * NOISE_M / math.sqrt(n), f"{what}: mean range error {mean * 1000:.2f} mm")
    expect(abs(deviation / NOISE_M - 1) < 4 / math.sqrt(2 * n), f"{what}: range noise {deviation * 1000:.2f} mm, in the scene {NOISE_M * 1000:.0f}")
    expect(max(map(abs, errors)) < 5.5 * NOISE_M, f"{what}: the worst range {max(map(abs, errors)) * 1000:.1f} mm off the truth")


def points_of(receiver_output):
    """The points of sweep SWEEP."""
    rows = (line.split() for line in receiver_output.splitlines() if line[:1].isdigit())
    return [tuple(map(float, row[1:4])) for row in rows if int(row[0]) == SWEEP]


if not RECEIVER.exists():
    support.skip("PCL was not there when this was built; try: apt-get install libpcl-dev")

folder = support.work_folder()
scene, trajectory = write_scene(folder), folder / "trajectory.csv"
write_trajectory(trajectory)
sweeps = {}
for name, make in LIDARS.items():
    truth = read_truth(scene, name, trajectory, folder)
    sweeps[name] = split_as_pcl_does(truth, make)[SWEEP]
    ranges = [shot["range_m"] for shot, _, _ in sweeps[name]]
    expect(len(truth) > 4 * (28000 if make == "VLP-16" else 69000), f"narpa scan lists {len(truth)} shots of the {make}")
    expect(len(ranges) > 5000 and max(ranges) < 8, f"{make}: sweep {SWEEP} has {len(ranges)} hits up to {max(ranges):.2f} m")
    compare_noise(sweeps[name], make)

can_port, ports, receivers, sinks = support.free_port(), {}, {}, []
for name, make in LIDARS.items():
    ports[name] = support.free_lidar_port()
    command = [RECEIVER, make, "udp", "127.0.0.1", str(ports[name]), str(SWEEP + 1), "600"]
    receivers[name] = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    expect(receivers[name].stdout.readline() == "ready\n", f"PCL listens for the {make}")
    for sink in (f"udp:127.0.0.1:{ports[name]}", folder / f"{name}.pcap"):
        sinks += ["--lidar", f"{name}={sink}"]
with support.Run(scene, "--can", f"slcan:{can_port}", *sinks, "--lockstep") as run:
    fly(run, can_port, trajectory)
    live = {name: receiver.communicate(timeout=900)[0] for name, receiver in receivers.items()}
    summary = run.stop()
print("summary:", summary["lidars"])
for name, make in LIDARS.items():
    expect(receivers[name].returncode == 0, f"PCL got the {make}'s sweeps live")
    compare(points_of(live[name]), sweeps[name], make, f"{make}, live over UDP")

    command = [RECEIVER, make, "pcap", folder / f"{name}.pcap", str(SWEEP + 1), "600"]
    recorded = subprocess.run(command, stdout=subprocess.PIPE, text=True)
    expect(recorded.returncode == 0, f"PCL got the {make}'s sweeps from the capture")
    compare(points_of(recorded.stdout), sweeps[name], make, f"{make}, from the capture")
