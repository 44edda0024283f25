#!/usr/bin/python3
"""`narpa calibrate` on frames of the scene `marks`, whose camera is known: from a wrong field of view it finds the camera within its
standard deviations, and one image leaves parameters undetermined, which it names."""
import json
import sys
from pathlib import Path

from support import expect, narpa, skip, work_folder

try:
    import numpy as np
except ImportError as error:
    skip(f"{error}: apt-get install python3-numpy")

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "python"))
from narpa import logs, rotation

folder = work_folder()
narpa("check", "marks", "--calibration", folder)
truth = logs.read_calibration(folder / "calibration.json")["nav"]
matrix = truth.matrix
KNOWN = {"fx": matrix[0, 0], "fy": matrix[1, 1], "cx": matrix[0, 2], "cy": matrix[1, 2], "k1": 0, "k2": 0, "p1": 0, "p2": 0, "k3": 0}
random = np.random.default_rng(3)
frames = []
for i in range(8):
    turn = random.normal(size=3)
    turn *= np.radians(random.uniform(8, 25)) / np.linalg.norm(turn)
    place = random.uniform(-0.25, 0.25, 3) * [1.5, 1, 0.8]
    frames.append(folder / f"frame{i}.png")
    pose = ",".join(f"{x:.9f}" for x in (*place, *rotation.from_vector(turn)))
    narpa("render", "marks", "--pose", f"board={pose}", "--spp", 64, "--seed", 5 + i, "-o", frames[-1])


def calibrated(images, *options):
    said = narpa("calibrate", "marks", *images, "--method", "marks", "-o", folder / "camera", "--set", "camera.nav.fov_horizontal_deg=38",
                 *options, "--json", status=None)  # fmt: skip
    print(said.stderr.decode())
    return json.loads(said.stdout)


report = calibrated(frames)
expect(report["passed"] and all(i["used"] for i in report["images"]), "eight images, all used")
expect([p["name"] for p in report["parameters"]] == list(KNOWN), "all parameters are estimated")
errors = np.array([p["value"] - KNOWN[p["name"]] for p in report["parameters"]])
for p, error in zip(report["parameters"], errors):
    expect(abs(error) < 4 * p["sigma"], f"{p['name']}: {error:.3g} off, {abs(error) / p['sigma']:.1f} sigma")
nees = errors @ np.linalg.solve(np.array(report["covariance"]), errors)
expect(nees < 33.7, f"NEES of the nine parameters together: {nees:.1f}, below the limit of 1 in 10,000")  # chi-square
expect(report["parameters"][0]["sigma"] < 1, "the focal length is known to a pixel")
written = (folder / "camera/nav.yaml").read_text()
expect("plumb_bob" in written and (folder / "camera/nav.images.csv").read_text().count("\n") == 9, "camera and rows are written")

few = calibrated(frames[:1], "--unknowns", "focal,centre_px,k1,k2,k3")
vague = [p["name"] for p in few["parameters"] if not p["determined"]]
expect("k3" in vague and few["undetermined"], f"of one image are not determined: {' '.join(vague)}")

for options, words in ((["--unknowns", "scale"], "expected NAME=VALUE with one of focal, aspect, centre_px, k1"),
                       (["--pose", "board=9,0,0,1,0,0,0"], "no image shows the target")):  # fmt: skip
    refused = narpa("calibrate", "marks", frames[0], "--method", "marks", "-o", folder / "camera", *options, status=2 if "--unknowns" in options else 1)
    expect(words in refused.stderr.decode(), f"refused: {words}")
