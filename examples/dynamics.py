#!/usr/bin/python3
"""Flies the chaser of scenes/rehearsal in lockstep: a rigid body without gravity, beside a target at rest.

Usage: dynamics.py BUS [SECONDS]      BUS: as `narpa run --can`: slcan:29537, vcan0, udp:239.74.163.2

At the start of each control period it reports the attitude that a star tracker would measure, commands the poses of all
bodies, and waits for the navigation's actuator command. Within the period it only commands poses.
"""
import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "python"))
from narpa import rotation
from narpa.can import Bus

PERIOD_S, POSES_PER_PERIOD = 1.0, 5
STEP_S = PERIOD_S / POSES_PER_PERIOD
PATIENCE_S = 60  # timeout for a command, wall time
CHASER, TARGET, EARTH = 0x100, 0x110, 0x120  # each body's can_id in scene.toml
AT_REST = {TARGET: (12.0, 0.0, 0.0), EARTH: (0.0, 0.0, -6778137.0)}  # m, world axes


class Chaser:
    """A rigid body. Position and velocity in world axes, rate in body axes."""

    MASS_KG, INERTIA_KG_M2 = 9500.0, np.array([22000.0, 31000.0, 31000.0])

    def __init__(self):
        self.position = np.array([37.0, 1.0, -0.8])
        self.velocity = np.array([0.01, 0.02, -0.01])
        self.attitude = np.array([0.0, 0.0, 0.0, 1.0])  # w, x, y, z
        self.rate = np.array([0.0003, -0.0002, 0.0002])

    def push(self, impulse, angular_impulse):
        """Applies an impulse (N s) and an angular impulse (N m s), both in body axes."""
        self.velocity = self.velocity + rotation.rotate(self.attitude, impulse) / self.MASS_KG
        self.rate = self.rate + np.array(angular_impulse) / self.INERTIA_KG_M2

    def move(self, seconds):
        self.position = self.position + self.velocity * seconds
        self.attitude = rotation.advanced(self.attitude, self.rate, seconds)


def report(bus, t_ns, chaser, phase):
    bus.send("Dynamics", Time=t_ns, Start=0, Phase=phase)
    bus.send("Attitude", Time=t_ns, Attitude=chaser.attitude, Rate=chaser.rate)


def command_poses(bus, t_ns, chaser):
    """Commands the chaser's pose last: it completes the set of poses of this time."""
    for can_id, position in AT_REST.items():
        bus.send_pose(can_id, t_ns, position, attitude=(1, 0, 0, 0))
    bus.send_pose(CHASER, t_ns, chaser.position, chaser.attitude, chaser.velocity, chaser.rate)


def await_actuator_command(bus, t_ns):
    until = time.monotonic() + PATIENCE_S
    while time.monotonic() < until:
        message = bus.receive(timeout_s=1.0)
        if message and message.name == "Actuator" and message["Time"] == t_ns:
            return message.vector("Impulse"), message.vector("AngularImpulse")
    sys.exit(f"no actuator command for t = {t_ns * 1e-9} s within {PATIENCE_S} s")


def main(bus_name, seconds=60.0):
    chaser, last_step = Chaser(), round(float(seconds) / STEP_S)
    with Bus(bus_name, patience_s=30) as bus:
        for step in range(last_step + 1):
            t_ns = round(step * STEP_S * 1e9)
            period_begins = step % POSES_PER_PERIOD == 0
            if period_begins:
                report(bus, t_ns, chaser, "finished" if step == last_step else "flying")
            command_poses(bus, t_ns, chaser)
            if period_begins and step < last_step:
                impulse, angular_impulse = await_actuator_command(bus, t_ns)
                chaser.push(impulse, angular_impulse)
                print(f"{step // POSES_PER_PERIOD}: at {np.round(chaser.position, 3)} m, {np.round(chaser.velocity, 3)} m/s, "
                      f"impulse {np.round(impulse, 1)} N s", flush=True)  # fmt: skip
            chaser.move(STEP_S)


if __name__ == "__main__":
    main(*sys.argv[1:])
