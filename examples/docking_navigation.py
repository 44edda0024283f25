#!/usr/bin/python3
"""Docks by the lamps around the target's port: finds them with OpenCV, filters the relative motion, flies the scenario's legs.

Usage: narpa rehearse dispersions --navigation '/usr/bin/python3 examples/docking_navigation.py'

In lockstep, with one camera. `narpa rehearse` sets the environment variables BUS, VIDEO and LOG.

Axes: L rotates with the orbit of the target (x along its velocity, z up), which rests in L but for a small rotation; its
origin is the target's. T, C, K: target, chaser, camera. R_LC and q_LC take C to L. All times of a cycle are that of the image.
"""
import os
import sys
from pathlib import Path

import cv2
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "python"))
from narpa import rotation, y4m
from narpa.can import Bus
from narpa.logs import Run

LAMP_LEVEL = 150  # grey levels by which a lamp stands out
PIXEL_SIGMA = 0.35  # of a lamp's position in the image, px; 0.2, and more because those of consecutive images are correlated
Q_TC_DOCKED = np.array([0.0, 0.0, 0.0, 1.0])  # half a turn about z
MU_M3_S2 = 3.986004418e14  # of the Earth


def bright_spots(image, widest_px):
    """Centres (n, 2) and areas (n,) of spots that stand out from what an opening leaves, px. None at the image's edge."""
    kernel = np.ones((int(widest_px) + 5,) * 2, np.uint8)
    standing_out = cv2.morphologyEx(image, cv2.MORPH_TOPHAT, kernel)
    mask = (standing_out > LAMP_LEVEL).astype(np.uint8)
    _, _, stats, centres = cv2.connectedComponentsWithStats(mask, connectivity=4)
    left, top, width, height, areas = stats.T
    whole = (left > 0) & (top > 0) & (left + width < image.shape[1]) & (top + height < image.shape[0])
    return centres[whole], areas[whole]  # the background, the first one, is not whole either


def assign(expected, fits, spots, reach_px, window_px, scales=(1.0,)):
    """The index of each lamp's spot, or -1. fits: lamps x spots, whether the sizes agree.

    All expected pixels may be off by one shift of up to reach_px, and by one of the scales. Those count that bring most lamps
    within window_px of a spot.
    """
    best = np.full(len(expected), -1)
    centre = expected.mean(axis=0)
    for scale in scales:
        offsets = spots[None] - (centre + scale * (expected - centre))[:, None]  # lamps x spots x 2
        shifts = offsets[fits & (np.linalg.norm(offsets, axis=2) < reach_px)]
        for shift in [np.zeros(2), *shifts]:
            distances = np.where(fits, np.linalg.norm(offsets - shift, axis=2), np.inf)
            found = np.where(distances.min(axis=1) < window_px, distances.argmin(axis=1), -1)
            if (found >= 0).sum() > (best >= 0).sum():
                best = found
    return best


class RelativeFilter:
    """An extended Kalman filter. State: position r (m) and velocity v (m/s) of the chaser's centre of mass, and the attitude
    q_LT of the target, all in L. Its nine errors: of r, of v, and a rotation vector in L."""

    def __init__(self, scenario, camera, marks, orbit_rate, R_LC):
        self.camera, self.period = camera, scenario["navigation"]["period_s"]
        self.lamps = np.array([mark.position_m for mark in marks])  # in T
        self.radii = np.array([mark["radius_m"] for mark in marks])
        self.chaser_centre = np.array(scenario["chaser"]["centre_of_mass_m"])
        self.R_KC = rotation.to_matrix(rotation.conjugate(camera.attitude))
        start = scenario["start"]
        self.r, self.v = start["position_m"] + R_LC @ self.chaser_centre, np.zeros(3)
        self.q_LT = np.array([1.0, 0, 0, 0])
        sigmas = [start["position_sigma_m"], start["velocity_sigma_m_s"], np.radians(start["attitude_sigma_deg"])]
        self.P = np.diag(np.concatenate(sigmas) ** 2)
        self.locked = False  # whether lamps have been found

        n, A = orbit_rate, np.eye(6, k=3)  # Hill's equations: (r, v)' = A (r, v)
        A[3, 5], A[4, 1], A[5, 2], A[5, 3] = -2 * n, -n * n, 3 * n * n, 2 * n
        self.hill = A[3:]
        self.F = np.eye(9)  # over a period
        self.F[:6, :6] += A * self.period + A @ A * self.period**2 / 2

    def free_acceleration(self):
        return self.hill @ np.concatenate([self.r, self.v])

    def predict(self, dv, shift):
        """Advances by a period in which thrusters change the velocity by dv, and with it the position by shift."""
        self.r, self.v = np.split(self.F[:6, :6] @ np.concatenate([self.r, self.v]), 2)
        self.r, self.v = self.r + shift, self.v + dv
        thrust = 0.02 * np.abs(dv) + 0.01 * np.linalg.norm(dv) + 1e-5  # standard deviation, m/s
        G = np.vstack([np.eye(3) * self.period / 2, np.eye(3), np.zeros((3, 3))])
        self.P = self.F @ self.P @ self.F.T + G @ np.diag(thrust**2) @ G.T + np.diag([0] * 6 + [1e-12] * 3)

    def expected(self, R_LC):
        """Pixels of the lamps (n, 2), their Jacobian (n, 2, 9) by the errors of the state, and their areas, px."""
        R_KL = self.R_KC @ R_LC.T
        lamps = self.lamps @ rotation.to_matrix(self.q_LT).T  # in L
        t = self.R_KC @ (self.chaser_centre - self.camera.position_m) - R_KL @ self.r
        pixels, jacobian = cv2.projectPoints(lamps, cv2.Rodrigues(R_KL)[0], t, self.camera.matrix, self.camera.distortion)
        by_point = jacobian[:, 3:6].reshape(-1, 2, 3) @ R_KL
        H = np.concatenate([-by_point, 0 * by_point, -np.cross(by_point, lamps[:, None])], axis=2)
        radii_px = self.camera.matrix[0, 0] * self.radii / (lamps @ R_KL.T + t)[:, 2]
        return pixels[:, 0], H, np.pi * radii_px**2

    def update(self, image, R_LC):
        """Uses the lamps of an image; returns how many. It is linearised three times, each time with a smaller window."""
        r, v, q_LT = self.r, self.v, self.q_LT
        pixels, H, areas = self.expected(R_LC)
        inside = ((pixels > 0) & (pixels < [self.camera["width"], self.camera["height"]])).all(axis=1)
        spots, spot_areas = bright_spots(image, 2 * np.sqrt(areas[inside].max(initial=1) / np.pi))
        fits = (spot_areas > 0.75 * areas[:, None] - 2) & (spot_areas < 1.25 * areas[:, None] + 3)
        reach_px = 3 * np.sqrt(np.einsum("nia,ab,nib->n", H, self.P, H).max()) + 1
        scales = [1.0] if self.locked else np.linspace(0.85, 1.15, 11)
        at_least, error = 4 if self.locked else 8, np.zeros(9)
        for reach_px, window_px, scales in [(reach_px, 2.5, scales), (0, 2.0, [1.0]), (0, 1.2, [1.0])]:
            found = assign(pixels, fits, spots, reach_px, window_px, scales)
            used = found >= 0
            if used.sum() < at_least:
                self.r, self.v, self.q_LT = r, v, q_LT
                return 0
            h = H[used].reshape(-1, 9)
            residual = (spots[found[used]] - pixels[used]).ravel() + h @ error
            K = self.P @ h.T @ np.linalg.inv(h @ self.P @ h.T + PIXEL_SIGMA**2 * np.eye(len(h)))
            error = K @ residual
            self.r, self.v = r + error[:3], v + error[3:6]
            self.q_LT = rotation.product(rotation.from_vector(error[6:]), q_LT)
            pixels, H, _ = self.expected(R_LC)
        self.P = (np.eye(9) - K @ h) @ self.P
        self.locked = True
        return int(used.sum())


class Guidance:
    """A reference for the chaser's port, in T, that moves along the legs of the scenario."""

    def __init__(self, scenario):
        self.legs, self.leg, self.held_s, self.period = scenario["leg"], 0, 0.0, scenario["navigation"]["period_s"]
        self.acceleration = 0.2 * scenario["thrusters"]["force_n"] / scenario["chaser"]["mass_kg"]  # of 1, the rest is for control
        self.position, self.velocity = np.array(scenario["start"]["position_m"]), np.zeros(3)

    def step(self, port):
        """Position and velocity now, acceleration over the next period, phase. port: where the chaser's port is."""
        leg = self.legs[self.leg]
        contact = leg.get("contact", False)
        end = np.array(leg["to_m"]) - ([1.0, 0, 0] if contact else 0)  # goes on until the contact
        left = np.linalg.norm(end - self.position)
        position, velocity = self.position, self.velocity
        speed = min(leg["speed_m_s"], np.linalg.norm(velocity) + self.acceleration * self.period,
                    np.sqrt(2 * self.acceleration * left), left / self.period)  # fmt: skip
        self.velocity = speed * (end - position) / left if left > 1e-3 else np.zeros(3)
        self.position = position + (velocity + self.velocity) / 2 * self.period if left > 1e-3 else end
        self.held_s += self.period if left <= 1e-3 else 0
        if self.held_s > leg.get("hold_s", 0) and np.linalg.norm(port - end) < leg.get("within_m", np.inf):
            self.leg, self.held_s = self.leg + 1, 0.0
        phase = "closing" if contact else "moving" if left > 1e-3 else "holding"
        return position, velocity, (self.velocity - velocity) / self.period, phase


class Thrusters:
    """Impulses that can be fired, along three axes. What is too small for a pulse is kept for later."""

    def __init__(self, scenario, strength):
        self.least, self.most = strength * scenario["thrusters"]["min_on_s"], strength * scenario["navigation"]["period_s"]
        self.kept = np.zeros(3)

    def fire(self, wanted):
        wanted = wanted + self.kept
        small = np.abs(wanted) < self.least
        self.kept = np.where(small, wanted, 0)
        return np.where(small, 0, np.clip(wanted, -self.most, self.most))


def pd(error, error_rate, bandwidth, damping=0.9):
    """The acceleration of a proportional-derivative controller; bandwidth in rad/s."""
    return bandwidth**2 * error + 2 * damping * bandwidth * error_rate


class Navigation:
    def __init__(self, scenario, camera, marks, start_ns):
        self.scenario, self.camera, self.marks, self.start_ns = scenario, camera, marks, start_ns
        self.orbit_rate = np.sqrt(MU_M3_S2 / scenario["orbit"]["radius_m"] ** 3)
        self.guidance = Guidance(scenario)
        self.forces = Thrusters(scenario, scenario["thrusters"]["force_n"])
        self.torques = Thrusters(scenario, scenario["thrusters"]["torque_n_m"])
        self.filter = self.thrust = None

    def cycle(self, report, image, captured):
        """The signals of Navigation and Actuator that answer an attitude report, with the image of its time or None."""
        t_s = (report["Time"] - self.start_ns) * 1e-9
        q_LC = rotation.product(rotation.from_vector([0, -self.orbit_rate * t_s, 0]), report.quaternion())
        R_LC = rotation.to_matrix(q_LC)
        if self.filter is None:
            self.filter = RelativeFilter(self.scenario, self.camera, self.marks, self.orbit_rate, R_LC)
        else:
            self.filter.predict(*self.thrust)
        lamps = 0 if image is None else self.filter.update(image, R_LC)
        print(f"{t_s:5.0f} s: {lamps:2d} lamps, centre of mass at {np.round(self.filter.r, 3)} m", flush=True)
        estimate = {**self.estimate(q_LC, R_LC), "Frames": int(lamps > 0), "Sweeps": 0}
        return estimate, self.command(q_LC, R_LC, np.array(report.vector("Rate")), captured)

    def estimate(self, q_LC, R_LC):
        """The target in C, with standard deviations: those of the filter, and that of the star tracker."""
        f, tracker = self.filter, np.radians(self.scenario["attitude_sensor"]["attitude_sigma_deg"])
        position_variance, rotation_variance = (np.diag(R_LC.T @ f.P[i : i + 3, i : i + 3] @ R_LC) for i in (0, 6))
        return {"Position": f.chaser_centre - R_LC.T @ f.r, "Sigma": np.sqrt(position_variance + tracker**2 * (f.r @ f.r)),
                "Attitude": rotation.product(rotation.conjugate(q_LC), f.q_LT), "SigmaRot": np.sqrt(rotation_variance + tracker**2)}  # fmt: skip

    def command(self, q_LC, R_LC, rate, captured):
        f, chaser, control = self.filter, self.scenario["chaser"], self.scenario["control"]
        period, R_LT = self.scenario["navigation"]["period_s"], rotation.to_matrix(f.q_LT)
        position, velocity, acceleration, phase = self.guidance.step(R_LT.T @ (f.r - R_LC @ f.chaser_centre))
        if captured:
            return {"Impulse": [0] * 3, "AngularImpulse": [0] * 3, "Leg": self.guidance.leg, "Phase": "docked"}
        r = R_LT @ (position + rotation.rotate(Q_TC_DOCKED, f.chaser_centre))  # the centre's reference
        force = R_LT @ acceleration - f.free_acceleration() + pd(r - f.r, R_LT @ velocity - f.v, control["bandwidth_rad_s"])
        turn = rotation.product(rotation.conjugate(q_LC), rotation.product(f.q_LT, Q_TC_DOCKED))
        turn_rate = R_LC.T @ [0, self.orbit_rate, 0] - rate
        torque = pd(rotation.to_vector(turn), turn_rate, control["attitude_bandwidth_rad_s"])
        impulse = self.forces.fire(chaser["mass_kg"] * period * (R_LC.T @ force))
        angular_impulse = self.torques.fire(np.array(chaser["inertia_kg_m2"]) * period * torque)
        dv, pulse_s = impulse / chaser["mass_kg"], np.abs(impulse) / self.scenario["thrusters"]["force_n"]
        self.thrust = R_LC @ dv, R_LC @ (dv * (period - pulse_s / 2))
        return {"Impulse": impulse, "AngularImpulse": angular_impulse, "Leg": self.guidance.leg, "Phase": phase}


def main():
    run, (camera, _, video) = Run(os.environ["LOG"]), os.environ["VIDEO"].partition("=")
    scenario, camera = run.scenario(), run.calibration()[camera]
    marks = run.marks(scenario["target"]["body"])
    frames, navigation, report, image, captured, cycle = y4m.Reader(video), None, None, None, False, 0
    with Bus(os.environ["BUS"], patience_s=30) as bus:
        print("ready", flush=True)
        for message in bus:
            if message.name == "Dynamics":
                navigation = navigation or Navigation(scenario, camera, marks, message["Start"])
                captured = message["Phase"] == "captured"
                if message["Phase"] == "finished":
                    break
            elif message.name == "Attitude":
                report = message
            elif message.name == "Ledger" and message["Delivery"] != "nothing":
                image = frames.read()
            elif message.name == "Heartbeat" and report and message["State"] != "starting":
                if message["Time"] * 1000 + 1000 < report["Time"]:
                    continue  # the image of the report's time may be still to come
                estimate, command = navigation.cycle(report, image, captured)
                if not captured:  # then the two move as one, which the filter does not know
                    bus.send("Navigation", Time=report["Time"], Cycle=cycle, **estimate)
                bus.send("Actuator", Time=report["Time"], Abort="none", **command)
                report, image, cycle = None, None, cycle + 1


if __name__ == "__main__":
    main()
