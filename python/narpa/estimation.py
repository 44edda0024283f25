"""Poses estimated from frames and sweeps: narpa.estimate."""
import dataclasses

import numpy as np

from .compiled import _narpa
from .errors import Error
from .rotation import to_matrix


@dataclasses.dataclass(frozen=True)
class Estimate:
    """The target's pose in the sensor's axes. Covariance and bound: (6, 6), errors (rotation rad, translation m), sensor axes."""

    answer: str  # "good", "unobservable" (right in the observed motions), "ambiguous" or "refused"
    why: str  # a sentence; empty where the answer is good
    passed: bool  # the pose is usable
    pose: np.ndarray | None  # T_sensor_target, (4, 4), m; None: there is none
    pose_in_world: np.ndarray | None  # T_world_target, (4, 4), m
    covariance: np.ndarray | None
    bound: np.ndarray | None  # Cramer-Rao, of the sensor's noise and what the method measures
    error_rotation_rad: float | None  # against the scene's pose; None with a guess
    error_position_m: float | None
    document: dict  # all of it, as `narpa estimate --json` prints it


def matrix_of(pose):
    """(4, 4) of {"position_m": ..., "attitude_wxyz": ...}."""
    matrix = np.eye(4)
    matrix[:3, :3] = to_matrix(pose["attitude_wxyz"])
    matrix[:3, 3] = pose["position_m"]
    return matrix


def estimate_of(document):
    def array(key):
        return np.array(document[key]) if key in document else None

    def matrix(key):
        return matrix_of(document[key]) if key in document else None

    answer = document["answer"]
    return Estimate(answer["class"], answer["why"], document["passed"], matrix("pose"), matrix("pose_in_world"), array("covariance"),
                    array("bound"), document.get("error_rotation_rad"), document.get("error_position_m"), document)  # fmt: skip


def pose_matrix(guess):
    """A (4, 4) matrix, or one of (position_m, attitude_wxyz)."""
    if isinstance(guess, tuple) and len(guess) == 2:
        return matrix_of({"position_m": guess[0], "attitude_wxyz": guess[1]})
    return np.asarray(guess, float)


def estimate(scene, sensor, measured, *, time_s=0.0, guess=None, method="dense", target="", start=(2.0, 2.0), uncertainty=None,
             frame_noise_dn=None, range_guess_m=0.0, range_noise_m=0.0, seed=1):  # fmt: skip
    """The pose of a target in one frame or one sweep, as `narpa estimate SCENE` finds it. Returns a narpa.Estimate.

    scene: narpa.Scene. The poses of its bodies are the truth, which light and errors are taken from; with `guess`, those of
        the other bodies.
    sensor: name of a camera or LiDAR of the scene.
    measured: of a camera, an array as Frame.dn. Of a LiDAR, the array of Scene.scan (what it reports, before the rounding of
        its packets), or a list of the data packets of one turn.
    time_s: middle of the exposure, or the first shot.
    guess: T_sensor_target as a (4, 4) matrix or as (position_m, attitude_wxyz). None: the truth displaced by `start`, (degrees,
        percent of the range), in a direction that `seed` draws. start="search": without a guess.
    method: of frames: "dense", "features", ... (docs/estimation.md). target: name of the body; "": the first with a mesh.
    uncertainty: standard deviations of what is not exact in the scene, {"scale": 0.001, "light_deg": 1, ...}.
    frame_noise_dn, range_guess_m, range_noise_m: as the options of `narpa estimate`.

    Raises narpa.Error where nothing can be estimated: no such sensor or target, an array that is no frame of this camera.
    """
    arguments = _narpa.EstimateArguments()
    arguments.method, arguments.target, arguments.seed = method, target, seed
    arguments.guess = None if guess is None else pose_matrix(guess)
    arguments.search = isinstance(start, str)
    if arguments.search and start != "search":
        raise Error(f'start {start!r}: expected (degrees, percent), or "search"')
    if not arguments.search:
        arguments.start_deg, arguments.start_percent = start
    arguments.uncertainty = dict(uncertainty or {})
    arguments.frame_noise_dn = frame_noise_dn
    arguments.range_guess_m, arguments.range_noise_m = range_guess_m, range_noise_m
    if sensor in scene.lidars:
        measured = measured if isinstance(measured, np.ndarray) else [bytes(packet) for packet in measured]
        return estimate_of(_narpa.estimate_sweep(scene, sensor, time_s, measured, arguments))
    return estimate_of(_narpa.estimate_frame(scene, sensor, time_s, np.asarray(measured), arguments))
