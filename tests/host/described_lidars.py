#!/usr/bin/python3
"""LiDARs described by files (scenes/lidars): compares their packets, decoded with narpa.points only, with the truth of each shot."""
import csv
import re

import support
from support import expect, narpa

try:
    import numpy as np
except ImportError as error:
    support.skip(f"{error} (python3-numpy)")
from narpa import points  # noqa: E402  (support sets the path)

folder = support.work_folder()
# For each instrument: shots per frame, range step (m), velocity step (m/s).
LIDARS = {"flash": (128 * 128, 0.01, None), "scanner": (250 * 100, 0.001, None), "velocimeter": (3, 0.1, 0.001)}


def truth_of(path):
    with open(path) as file:
        rows = list(csv.DictReader(file))
    return {key: np.array([float(row[key]) for row in rows]) for key in rows[0]}


def check(lidar, shots, range_step_m, velocity_step_m_s):
    for kind in ("csv", "pcap"):
        narpa("scan", "lidars", "--lidar", lidar, "--time", "1", "-o", folder / f"{lidar}.{kind}")
    truth = truth_of(folder / f"{lidar}.csv")
    packets = list(points.read_pcap(folder / f"{lidar}.pcap"))
    got = np.concatenate([packet.points for packet in packets])
    expect(len(truth["t_ns"]) == shots == packets[0].shots_per_frame, f"{lidar}: {shots} shots a frame")
    expect(len({packet.frame for packet in packets}) == 1, f"{len(packets)} packets of one frame")
    returned = truth["reported_range_m"] > 0
    expect((np.flatnonzero(returned) == got["shot"]).all(), f"{len(got)} returns of the shots that have one")
    of = {key: values[returned] for key, values in truth.items()}
    off = np.abs(got["range_m"] - of["reported_range_m"]).max()
    expect(off <= 0.5 * range_step_m + 1e-9, f"ranges within half a step of what was measured: {off:.2g} m")
    turn = np.remainder(got["azimuth_rad"] - of["azimuth_rad"] + np.pi, 2 * np.pi) - np.pi
    off = max(np.abs(turn).max(), np.abs(got["elevation_rad"] - of["elevation_rad"]).max())
    expect(off <= 0.51e-8, f"angles within half a step: {off:.2g} rad")
    off = np.abs(got["reflectivity"] - of["reported_reflectivity"]).max()
    expect(off <= 0.51e-3, f"reflectivities within half a step: {off:.2g}")
    t_ns = got["t_unix_ns"] - got["t_unix_ns"][0]
    expect(np.abs(t_ns - (of["t_ns"] - of["t_ns"][0])).max() < 1000, "times of the shots")  # CSV times are read as doubles
    if velocity_step_m_s is None:
        expect(np.isnan(got["velocity_m_s"]).all(), "no velocity")
    else:
        off = np.abs(got["velocity_m_s"] - of["reported_velocity_m_s"]).max()
        expect(off <= 0.5 * velocity_step_m_s + 1e-9, f"velocities within half a step: {off:.2g} m/s")
    return packets


def check_refusals():
    payload = bytearray(next(points.pcap.udp_payloads(folder / "velocimeter.pcap")))
    for what, changed in (("checksum", payload[:-1] + bytes([payload[-1] ^ 1])), ("bytes, expected", payload[:-1]), ("not a point packet", b"X" + payload[1:])):
        try:
            points.decode(bytes(changed))
            expect(False, f"refused: {what}")
        except ValueError as error:
            expect(re.search(what, str(error)), f"refused: {error}")


for lidar, figures in LIDARS.items():
    check(lidar, *figures)
check_refusals()
