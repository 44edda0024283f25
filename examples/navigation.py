#!/usr/bin/python3
"""Holds station relative to the target that the camera sees, without a model of the target.

Usage: navigation.py BUS VIDEO [RATE]      BUS: as `narpa run --can`; VIDEO: a FIFO or /dev/videoN
                                           RATE: of the target about its y axis, rad/s (default: that of the orbit)

Corners of the first frame are tracked through all later frames. Their shift and scale give the drift of the chaser. The
attitude comes from the star tracker's report on CAN. Once each control period a PD controller commands impulses.
"""
import sys
from pathlib import Path

import cv2
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "python"))
from narpa import rotation, y4m
from narpa.can import Bus

PERIOD_S, MASS_KG, INERTIA_KG_M2 = 1.0, 9500.0, np.array([22000.0, 31000.0, 31000.0])  # scenes/rehearsal/docking.toml
WIDTH, HEIGHT, FOCAL_PX = 320, 240, 386.3
RANGE_M = 28.0  # approximate distance to the target
R_CHASER_CAMERA = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
ORBIT_RATE_RAD_S = 1.1313e-3
MOST = 300.0  # largest impulse (N s) and angular impulse (N m s) of the thrusters in a period


def frames_of(video):
    """Yields grey frames, beginning with the first one of the stream."""
    if not video.startswith("/dev/"):
        yield from y4m.Reader(video)
    device = cv2.VideoCapture(video, cv2.CAP_V4L2)
    device.set(cv2.CAP_PROP_CONVERT_RGB, 0)
    while True:
        yield device.read()[1].reshape(HEIGHT, WIDTH)


class CornerTracker:
    """Estimates the target's position in camera axes from the shift and scale of the first frame's corners."""

    def __init__(self, first):
        self.first, self.corners = first, cv2.goodFeaturesToTrack(first, maxCorners=200, qualityLevel=0.02, minDistance=6)
        self.fit = np.eye(2, 3)  # similarity transform from the first to the latest frame
        self.matched = 0

    def target(self, frame):
        expected = cv2.transform(self.corners, self.fit)
        now, found, _ = cv2.calcOpticalFlowPyrLK(self.first, frame, self.corners, expected, winSize=(25, 25), maxLevel=2,
                                                 flags=cv2.OPTFLOW_USE_INITIAL_FLOW)  # fmt: skip
        self.fit, same = cv2.estimateAffinePartial2D(self.corners[found == 1], now[found == 1], ransacReprojThreshold=1.0)
        self.matched = int(same.sum())
        centre = np.array([WIDTH / 2, HEIGHT / 2])
        shift = (self.fit @ np.append(centre, 1) - centre) / FOCAL_PX
        scale = np.hypot(self.fit[0, 0], self.fit[1, 0])
        return RANGE_M / scale * np.append(shift, 1)


class StationKeeper:
    """Filters the drift and computes the impulses that correct it. The desired attitude rotates with the target."""

    def __init__(self, attitude, t_ns, target_rate):
        self.first_attitude, self.first_ns, self.target_rate = attitude, t_ns, np.array([0.0, target_rate, 0.0])
        self.drift, self.drift_rate = np.zeros(3), np.zeros(3)  # of the target: m and m/s, axes of the desired attitude

    def command(self, t_ns, attitude, rate, target_camera):
        """Impulse and angular impulse in body axes, and the attitude error, rad."""
        turned = rotation.from_vector(self.target_rate * (t_ns - self.first_ns) * 1e-9)
        wanted = rotation.product(turned, self.first_attitude)
        off = rotation.product(rotation.conjugate(wanted), attitude)
        measured = rotation.rotate(off, R_CHASER_CAMERA @ target_camera) - [RANGE_M, 0, 0]
        predicted = self.drift + self.drift_rate * PERIOD_S
        innovation = measured - predicted
        self.drift = predicted + 0.6 * innovation
        self.drift_rate = self.drift_rate + 0.3 * innovation / PERIOD_S

        angle = rotation.to_vector(off)
        rate_off = rate - rotation.rotate(rotation.conjugate(attitude), self.target_rate)
        impulse = MASS_KG * PERIOD_S * pd(self.drift, self.drift_rate, bandwidth=0.12)
        angular_impulse = -INERTIA_KG_M2 * PERIOD_S * pd(angle, rate_off, bandwidth=0.25)
        impulse, angular_impulse = np.clip(impulse, -MOST, MOST), np.clip(angular_impulse, -MOST, MOST)
        self.drift_rate = self.drift_rate - impulse / MASS_KG
        return impulse, angular_impulse, angle


def pd(error, error_rate, bandwidth, damping=0.9):
    """The acceleration of a proportional-derivative controller; bandwidth in rad/s."""
    return bandwidth**2 * error + 2 * damping * bandwidth * error_rate


def main(bus_name, video, target_rate=ORBIT_RATE_RAD_S):
    frames, tracker, keeper, target, report, cycle = frames_of(video), None, None, None, None, 0
    with Bus(bus_name, patience_s=30) as bus:
        print("ready", flush=True)
        for message in bus:
            if message.name == "Dynamics" and message["Phase"] == "finished":
                break
            if message.name == "Attitude":
                report = message  # the actuator command for its time is due
            if message.name == "Ledger" and message["Delivery"] != "nothing":
                frame = next(frames)
                if tracker is None and report and message["ExposureMid"] >= report["Time"]:
                    tracker = CornerTracker(frame)
                if tracker:
                    target = tracker.target(frame)
            emulator_is_there = (message.name == "Heartbeat" and message["State"] != "starting" and report is not None
                                 and message["Time"] * 1000 + 1000 > report["Time"])  # fmt: skip
            if not (emulator_is_there and tracker):
                continue
            t_ns, attitude, rate = report["Time"], report.quaternion(), np.array(report.vector("Rate"))
            keeper = keeper or StationKeeper(attitude, t_ns, float(target_rate))
            impulse, angular_impulse, angle = keeper.command(t_ns, attitude, rate, target)
            bus.send("Actuator", Time=t_ns, Impulse=impulse, AngularImpulse=angular_impulse, Leg=0, Phase="holding", Abort="none")
            print(f"{cycle:4d}: off by {np.round(keeper.drift, 3)} m, {np.round(np.degrees(angle), 2)} deg, "
                  f"{tracker.matched} corners", flush=True)  # fmt: skip
            cycle, report = cycle + 1, None


if __name__ == "__main__":
    main(*sys.argv[1:])
