#!/usr/bin/python3
"""PCL's unmodified VLP grabber decodes a moving LiDAR's packets, live over UDP and from the capture of the same run;
every point of a whole sweep lies within 3 mm of the ray-traced hit at its own shot time, none is missing, none extra.

What PCL 1.13 neglects (its vlp_grabber.cpp): a laser's own firing time within a sequence of 16, so
that all 16 get the azimuth of the sequence's start; the height at which a beam crosses the axis; fractions of 0.01 deg.
The first two are corrected here before points are compared; the third is 1 mm at 6 m, part of the 3 mm.
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
    import can, serial  # noqa: F401: what support.open_bus needs
except ImportError as error:
    support.skip(f"{error} (python3-can, python3-serial)")

RECEIVER = Path(os.environ["NARPA_BUILD_DIR"]) / "bin/pcl_vlp_receiver"
SWEEP = 1  # counted from 0: between the second and the third passage of azimuth 0
TOLERANCE_M = 0.003
# Between commands of 10 ms of flight, 8 packets: PCL's socket keeps 92, so that PCL may pause for over a second.
PACE_S = 0.1
# Velodyne, VLP-16 User Manual 63-9243 Rev. D, table 9-1: vertical correction by laser, metres.
CORRECTION_M = [h * 1e-3 for h in (11.2, -0.7, 9.7, -2.2, 8.1, -3.7, 6.6, -5.1, 5.1, -6.6, 3.7, -8.1, 2.2, -9.7, 0.7, -11.2)]


def write_trajectory(path):
    """The chaser drifts and turns fast: a shot's own time moves its hit by up to 10 cm within the sweep."""
    lines = ["t_s,body,x_m,y_m,z_m,qw,qx,qy,qz,vx_m_s,vy_m_s,vz_m_s,wx_rad_s,wy_rad_s,wz_rad_s"]
    rate = 0.4  # rad/s about the body's y
    for i in range(41):
        t = 0.01 * i
        q = (math.cos(rate * t / 2), 0.0, math.sin(rate * t / 2), 0.0)
        numbers = (t, 0.6 * t, -0.2 * t, 0.8 * t, *q, 0.6, -0.2, 0.8, 0.0, rate, 0.0)
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


def read_truth(trajectory, folder):
    """Every shot of the first four turns in firing order, as dictionaries of numbers."""
    path = folder / "truth.csv"
    support.narpa("scan", support.SCENE, "--lidar", support.LIDAR, "--trajectory", trajectory, "--duration", 0.4, "-o", path)
    with open(path, newline="") as file:
        return [
            row | {k: float(row[k]) for k in ("azimuth_rad", "range_m", "x_m", "y_m", "z_m")}
            for row in csv.DictReader(file)
        ]


def split_as_pcl_does(truth):
    """Whole sweeps of hits, each with the azimuth (0.01 deg) that PCL uses: a sweep ends where it decreases."""
    sweeps, last = [[]], -1.0
    for at in range(0, len(truth) - 383, 384):
        packet = truth[at : at + 384]
        starts = [round(math.degrees(packet[32 * block]["azimuth_rad"]) * 100) % 36000 for block in range(12)]
        half = (starts[1] - starts[0]) % 36000 / 2
        for i, shot in enumerate(packet):
            azimuth = starts[i // 32] + (half if i % 32 >= 16 else 0)
            azimuth -= 36000 if azimuth > 36000 else 0
            if not shot["range_m"] > 0:
                continue
            if azimuth < last:
                sweeps.append([])
            last = azimuth
            sequence_start = packet[i - i % 16]["azimuth_rad"]
            sweeps[-1].append((shot, int(azimuth), shot["azimuth_rad"] - sequence_start))
    return sweeps


def compare(points, truth_sweep, what):
    expect(len(points) == len(truth_sweep), f"{what}: {len(points)} points, {len(truth_sweep)} ray-traced hits")
    worst = 0.0
    for (x, y, z), (shot, azimuth_cdeg, into_sequence) in zip(points, truth_sweep):
        pcl_azimuth = math.atan2(x, y)
        off = math.remainder(pcl_azimuth - math.radians(azimuth_cdeg / 100), 2 * math.pi)
        if abs(off) > math.radians(1e-3):
            expect(False, f"{what}: PCL's azimuth {math.degrees(pcl_azimuth) % 360:.4f} deg, expected {azimuth_cdeg / 100} deg")
        horizontal, azimuth = math.hypot(x, y), pcl_azimuth + math.remainder(into_sequence, 2 * math.pi)
        corrected = (horizontal * math.sin(azimuth), horizontal * math.cos(azimuth), z + CORRECTION_M[int(shot["laser"])])
        worst = max(worst, math.dist(corrected, (shot["x_m"], shot["y_m"], shot["z_m"])))
    expect(worst <= TOLERANCE_M, f"{what}: {len(points)} points, none missing or extra, the worst {worst * 1000:.2f} mm from its hit")


def points_of(receiver_output):
    """The points of sweep SWEEP."""
    rows = (line.split() for line in receiver_output.splitlines() if line[:1].isdigit())
    return [tuple(map(float, row[1:4])) for row in rows if int(row[0]) == SWEEP]


if not RECEIVER.exists():
    support.skip("PCL was not there when this was built; try: apt-get install libpcl-dev")

folder = support.work_folder()
trajectory, capture = folder / "trajectory.csv", folder / "top.pcap"
write_trajectory(trajectory)
truth = read_truth(trajectory, folder)
sweeps = split_as_pcl_does(truth)
ranges = [shot["range_m"] for shot, _, _ in sweeps[SWEEP]]
expect(len(truth) > 4 * 28000, f"narpa scan lists {len(truth)} shots")
expect(len(ranges) > 5000 and max(ranges) < 6.5, f"sweep {SWEEP} has {len(ranges)} hits up to {max(ranges):.2f} m")

can_port, udp_port = support.free_port(), support.free_lidar_port()
receiver = subprocess.Popen([RECEIVER, "udp", "127.0.0.1", str(udp_port), str(SWEEP + 1), "60"], stdout=subprocess.PIPE, text=True)
expect(receiver.stdout.readline() == "ready\n", "PCL listens")
lidar = ("--lidar", f"{support.LIDAR}=udp:127.0.0.1:{udp_port}", "--lidar", f"{support.LIDAR}={capture}")
with support.Run(support.SCENE, "--can", f"slcan:{can_port}", *lidar, "--lockstep") as run:
    fly(run, can_port, trajectory)
    live, _ = receiver.communicate(timeout=90)
    summary = run.stop()
print("summary:", summary["lidars"])
expect(receiver.returncode == 0, "PCL got its sweeps live")
compare(points_of(live), sweeps[SWEEP], "live over UDP")

recorded = subprocess.run([RECEIVER, "pcap", capture, str(SWEEP + 1), "60"], stdout=subprocess.PIPE, text=True)
expect(recorded.returncode == 0, "PCL got its sweeps from the capture")
compare(points_of(recorded.stdout), sweeps[SWEEP], "from the capture")
