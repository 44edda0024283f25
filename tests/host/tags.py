#!/usr/bin/python3
"""Tags of the scene `marks`, found in its frames by detectors that others wrote: OpenCV's aruco and AprilTag's own.

Each detector's pose, by the marks and camera matrix of calibration.json, agrees with the truth; narpa's agrees within its covariance.
"""
import json
import sys
import tempfile
from pathlib import Path

from support import expect, narpa, skip

try:
    import cv2
    import numpy as np
    from apriltag import apriltag
except ImportError as error:
    skip(f"{error}: apt-get install python3-opencv python3-apriltag")

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "python"))
from narpa import logs, rotation

# Of the board: position m, quaternion w, x, y, z.
POSES = ("0,0,0,1,0,0,0", "0.1,-0.05,0.08,0.985,0.1,-0.1,0.08", "-0.5,0.1,0,0.96,-0.05,0.2,-0.15")


def found_by_opencv(image):
    """{id: 4 x 2 corners, clockwise from the top left}"""
    parameters = cv2.aruco.DetectorParameters_create()
    parameters.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
    known = cv2.aruco.Dictionary_get(cv2.aruco.DICT_4X4_50)
    corners, ids, _ = cv2.aruco.detectMarkers(image, known, parameters=parameters)
    return {} if ids is None else {int(i): c[0] for i, c in zip(ids.ravel(), corners)}


def found_by_apriltag(image):
    # Its axes are turned by half a turn against OpenCV's; its image point (0, 0) is a pixel's corner.
    return {tag["id"]: tag["lb-rb-rt-lt"][[1, 0, 3, 2]] - 0.5 for tag in apriltag("tag36h11").detect(image)}


def pose(points, pixels, camera):
    _, turn, shift = cv2.solvePnP(np.array(points), np.array(pixels, float), camera.matrix, camera.distortion, flags=cv2.SOLVEPNP_SQPNP)
    turn, shift = cv2.solvePnPRefineLM(np.array(points), np.array(pixels, float), camera.matrix, camera.distortion, turn, shift)
    return shift.ravel(), rotation.from_vector(turn.ravel())


with tempfile.TemporaryDirectory() as name:
    folder = Path(name)
    narpa("check", "marks", "--calibration", folder)
    camera = logs.read_calibration(folder / "calibration.json")["nav"]
    tags = [m for m in logs.read_marks(folder / "calibration.json", "board") if m.kind == "tag"]
    for text in POSES:
        numbers = np.array(text.split(","), float)
        numbers[3:] /= np.linalg.norm(numbers[3:])
        text = ",".join(f"{x:.12f}" for x in numbers)
        raw = folder / "frame.raw"
        narpa("render", "marks", "--pose", f"board={text}", "-o", raw)
        image = np.fromfile(raw, np.uint8).reshape(camera["height"], camera["width"])
        said = narpa("estimate", "marks", "--pose", f"board={text}", "--frame", raw, "--method", "marks", "--start", "10,10", "--json")
        answer = json.loads(said.stdout)
        expect(answer["answer"]["class"] == "good" and answer["nees"] < 22.5, f"narpa: NEES {answer['nees']:.1f}")
        truth_m, truth_q = np.array(answer["truth"]["position_m"]), np.array(answer["truth"]["attitude_wxyz"])
        for detector, dictionary, found in (("OpenCV", "4X4_50", found_by_opencv(image)),
                                            ("AprilTag", "APRILTAG_36h11", found_by_apriltag(image))):  # fmt: skip
            wanted = [t for t in tags if t["dictionary"] == dictionary]
            expect(sorted(found) == sorted(t["id"] for t in wanted), f"{detector} finds its tags: {sorted(found)}")
            at_m, attitude = pose(np.concatenate([t.corners_m for t in wanted]), np.concatenate([found[t["id"]] for t in wanted]), camera)
            off_mm = 1e3 * np.linalg.norm(at_m - truth_m)
            off_deg = np.degrees(rotation.angle(attitude, truth_q))
            expect(off_mm < 6 and off_deg < 0.5, f"{detector}: {off_mm:.2f} mm and {off_deg:.3f} deg off the truth")
