"""narpa.plots and the program narpa-plot: every kind of document becomes a picture, and invalid documents give an error message.

With NARPA_PLOTS=FOLDER the pictures are kept there for inspection.
"""
import base64
import json
import os
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path
from xml.etree import ElementTree

import needs

needs.modules("matplotlib", "numpy")

import numpy as np
from narpa import plots

NARPA_PLOT = Path(__file__).resolve().parents[2] / "python/narpa-plot"
random = np.random.default_rng(1)


def estimate(value):
    return {"value": value, "standard_error": 0.05 * abs(value)}


def image(width, height, channels=1):
    pixels = np.linspace(0, 254, width * height * channels).astype(np.uint8)
    return {"width": width, "height": height, "channels": channels, "base64": base64.b64encode(pixels.tobytes()).decode()}


def convergence():
    rows = [{"spp": n, "rmse": estimate(0.1 * n**-0.5), "relative_rmse": estimate(0.5 * n**-0.6), "render_s": 0.01 * n} for n in (4, 8, 16, 32)]
    return {"rows": rows, "reference": {"mean": 0.3}, "slope": estimate(-0.5), "relative_slope": estimate(-0.6)}


def ladder(scenes=2):
    def rung(name, s, error, **more):
        phases = {"aim": 0.1, "rays": 0.4, "shading": 0.2, "shadow_rays": 0.2, "indirect": 0, "passes": 0.1}
        return {"name": name, "loop": False, "adaptive": False, "median_s": s, "rmse": estimate(error), "predicted": 0.9 * error,
                "step": "refined", "phase_s": phases, **more}  # fmt: skip

    rungs = [rung(f"{n} spp", 0.004 * n, 0.05 * n**-0.5) for n in (1, 4, 16)]
    rungs += [rung(f"{n} rays/px", 0.003 * n, 0.03 * n**-0.6, adaptive=True) for n in (2, 4, 8)]
    rungs += [rung("1 rays/px", 0.002, 0.06, adaptive=True, step="coarse_2", predicted=None)]
    rungs += [{**rung(f"loop {n} spp", 0.02 * n, 0.06 * n**-0.5), "loop": True, "predicted": None} for n in (1, 4, 16, 64)]
    speed_up = {"rays": {"median": 4.2}, "spp": {"median": 3.1}}
    one = {"scene": "craft", "width": 512, "height": 384, "reference": {"mean": 1}, "detector_s": 0.001, "rungs": rungs, "speed_up": speed_up}
    return {"scenes": [one] * scenes}


def loop():
    def camera(scale):
        times = np.sort(scale * random.lognormal(0, 0.6, 200))
        points = [[t, 1 - k / 200] for k, t in enumerate(times)]
        return {"name": "nav", "wake_late_ms": points, "hand_over_ms": points, "late_ms": [[t - 5 * scale, f] for t, f in points]}

    return {"runs": [{"name": name, "cameras": [camera(s)]} for name, s in (("idle", 1), ("loaded", 3))]}


def estimates():
    keys = ("error", "sigma", "bound", "filtered")
    frames = []
    for k in range(60):
        size = {"error": random.lognormal(-1), "sigma": 1, "bound": 0.5, "filtered": 0.3}
        gone = k in (20, 21)
        frames.append({"frame": k, "t_s": 0.1 * k} | {f"{q}_{key}_{u}": None if gone else f * size[key]
                      for q, u, f in (("rotation", "rad", 1e-3), ("position", "m", 0.01)) for key in keys})  # fmt: skip
    return {"frames": frames}


def calibration():
    points = np.column_stack([random.uniform(0, 640, 200), random.uniform(0, 480, 200), random.normal(0, 0.1, (200, 2))])
    rows = [{"image": f"left{i:02}.jpg", "rms_px": 0.1 + 0.01 * i} for i in range(5)]
    return {"title": "board: camera cam", "width": 640, "height": 480, "rms_px": 0.14, "points": points.tolist(), "images": rows}


def batch():
    states = [{"t_s": 0.5 * k, "rotation_error_rad": 1e-3 * random.lognormal(-1), "position_error_m": 0.01 * random.lognormal(-1),
               "rotation_sigma_rad": 1e-3, "position_sigma_m": 0.01} for k in range(40)]  # fmt: skip
    residuals = [{"t_s": 0.5 * k, "measure": ("camera", "lidar", "brightness")[k % 3], "start": 0.3, "end": 0.1} for k in range(40)]
    unknowns = [{"name": name, "change": 0.8, "sigma": 0.1 if known else 0.95, "prior_sigma": 1, "truth": 0.9, "determined": known}
                for name, known in (("focal", True), ("scale", False), ("clock_s", True))]  # fmt: skip
    return {"states": states, "residuals": residuals, "unknowns": unknowns}


def approach():
    def run(method):
        ranges = np.geomspace(100, 1.2, 60)
        frames = [{"range_m": r, "found": k % 17 != 3, "rotation_rad": 1e-3 * random.lognormal(), "position_m": 1e-3 * r * random.lognormal(),
                   "bound_rotation_rad": 1e-3, "bound_position_m": 1e-3 * r} for k, r in enumerate(ranges)]  # fmt: skip
        return {"method": method, "frames": frames, "basin": [{"off_deg_and_percent": d, "trials": 10, "found": 10 - d // 4} for d in (2, 10, 30)]}

    return {"runs": [run("features"), run("dense")]}


def approach_frames():
    frame = {"range_m": 20.0, "rotation_deg": 0.01, "position_m": 0.003, "image": image(320, 240), "render": image(320, 240),
             "matches_px": [[5, 1], [1.2, 0.4], [0.4, 0.39]]}  # fmt: skip
    return {"frames": [frame] * 5}


def stereo():
    matches = []
    for _ in range(60):
        left = random.uniform(20, 180, 2)
        error = random.normal(0, 1, 3) * [0.1, 0.2, 1]
        matches.append({"left_px": left.tolist(), "right_px": (left + [-12, 3]).tolist(), "truth_m": [10, 20, 800],
                        "whole_pixels_error_m": (10 * error).tolist(), "between_pixels_error_m": error.tolist()})  # fmt: skip
    return {"scene": "descent", "gain": 10.0, "mean_normalised_squared": 1.02, "matches": matches, "left": image(200, 200)}


def icp():
    runs = [{"start_angle_deg": a, "start_distance_fraction": d, "starts": 100, "found": 100 - 3 * a, "told": 2 * a, "microseconds_p50": 900}
            for a, d in ((5, 0.05), (10, 0.1), (20, 0.2), (30, 0.3))]  # fmt: skip
    return {"runs": runs}


def filter_():
    times = [{"t_s": t, "nees": 12 + random.normal(0, 0.6)} for t in range(1, 61)]
    return {"runs": [{"name": name, "nees": 12.1, "band": [11, 13], "inside_band": 0.94, "times": times} for name in ("free", "orbit", "late")]}


def estimators():
    return {"estimators": [{"estimator": n, "family": f, "ms": t, "position_error_of_range": e} for n, f, t, e in (
        ("EPnP", "points", 0.02, 1e-3), ("OpenCV's", "points", 0.021, 1.02e-3), ("features", "render and compare", 40, 2e-4),
        ("ICP of a sweep", "LiDAR", 0.9, 5e-4))]}  # fmt: skip


def replay():
    return {"caption": "frame 3: refined", "difference_range_percent": 0.4, "frame": image(64, 48, 3), "reference": image(64, 48, 3),
            "difference": image(64, 48)}  # fmt: skip


def comparison(width=64):
    return {"frame": image(width, 48), "render": image(width, 48), "residual": image(width, 48), "residual_range_dn": 12.5}


def rehearsal(lockstep=False, flown=True):
    t = np.arange(0, 100, 0.5) if flown else np.zeros(0)
    x = 30 * np.exp(-t / 30)
    position = np.stack([x, 0.1 * np.sin(t / 5), 0.05 * np.cos(t / 7)], 1)
    error = random.normal(0, 0.01, (len(t), 3))
    truth = {"t_s": t, "position_m": position, "range_m": x, "closing_m_s": x / 30, "lateral_m_s": 0.02 * np.abs(np.cos(t / 5))}
    found = {"t_s": t, "port_position_m": position + error, "position_error_m": error, "position_sigma_m": 0.01 + 0 * error,
             "attitude_error_rad": 0.1 * error, "attitude_sigma_rad": 1e-3 + 0 * error, "frame_times_s": t[::2], "sweep_times_s": t[::5]}  # fmt: skip
    limits = {"lateral_m": 0.1, "closing_m_s": [0.05, 0.1], "lateral_m_s": 0.04, "pitch_yaw_deg": 4, "roll_deg": 4}
    document = {
        "t_end_s": 100.0 if flown else 0.0, "truth": truth, "estimates": found, "holds_m": [[20, 0, 0], [5, 0, 0]],
        "phases": [{"from_s": 0, "to_s": 40, "phase": "moving", "leg": 1}, {"from_s": 40, "to_s": 100, "phase": "closing", "leg": 2}],
        "gates": {"corridor": {"half_angle_deg": 10, "radius_m": 0.5, "from_m": 20}, "keep_out_m": 5, "distance_m": None, "contact": limits},
        "contact": {"t_s": 99, "captured": True, "position_m": [0, 0.02, 0.01]} if flown else None,
        "thrusters": {"t_s": t, "impulse_n_s": 100 * error, "angular_impulse_n_m_s": error, "delta_v_m_s": 0.01 * t},
        "latency": {"t_s": [] if lockstep else t, "ms": [] if lockstep else 20 + 0 * t},
    }  # fmt: skip
    return json.loads(json.dumps(document, default=lambda array: array.tolist()))


def campaign(runs=40):
    one = lambda k: {"run": k, "within": k % 9 != 0, "position_m": [0, *(0.03 * random.normal(size=2))], "closing_m_s": 0.075,
                     "lateral_m_s": 0.01, "pitch_yaw_deg": 0.5, "roll_deg": 0.2}  # fmt: skip
    limits = {"lateral_m": 0.1, "closing_m_s": [0.05, 0.1], "lateral_m_s": 0.04, "pitch_yaw_deg": 4, "roll_deg": 4}
    return {"limits": limits, "runs": [one(k) for k in range(runs)]}


def surface_map(interval=1.0):
    values = np.float32(np.hypot(*np.mgrid[-20:20, -30:30]))
    values[:5, :5] = np.nan
    circle = [[30 + 10 * np.cos(t), 20 + 10 * np.sin(t)] for t in np.linspace(0, 2 * np.pi, 40)]
    return {"of": "height", "datum_m": 1.5, "lowest_m": 0.0, "highest_m": 36.1, "width": 60, "height": 40,
            "values_m": base64.b64encode(values.tobytes()).decode(), "shade": image(60, 40), "interval_m": interval,
            "levels_m": [interval * k for k in range(1, 37)],
            "lines": [{"level_m": 10.0, "closed": True, "px": circle, "position_m": [[0, 0, 0]] * 40}] if interval == 1 else []}  # fmt: skip


def dataset(images=40):
    def histogram(label, values, logarithmic=False):
        counts, edges = np.histogram(values, 12) if len(values) else ([], [])
        return {"label": label, "logarithmic": logarithmic, "edges": list(map(float, edges)), "counts": list(map(int, counts))}

    return {"images": images, "empty_images": 1, "empty_share": 1 / max(1, images),
            "histograms": {"range_m": histogram("range, m", random.uniform(2, 50, images), True), "phase_deg": histogram("phase angle, deg", []),
                           "brightness": histogram("brightness", np.full(images, 0.1))}}  # fmt: skip


def contact_sheet(tiles=8):
    one = lambda k: {"image": k, "pixels": image(64, 48), "step": 2, "range_m": 12.5, "phase_deg": None if k % 2 else 30.0,
                     "keypoints": [[[10.0, 20.0], "visible"], [[40.0, 50.0], "occluded"]], "boxes": [[8, 10, 60, 50]] if k else []}  # fmt: skip
    return {"tiles": [one(k) for k in range(tiles)]}


DOCUMENTS = {"convergence": convergence, "ladder": ladder, "loop": loop, "estimates": estimates, "batch": batch, "calibration": calibration, "approach": approach,
             "approach_frames": approach_frames, "stereo": stereo, "icp": icp, "filter": filter_, "estimators": estimators,
             "replay": replay, "rehearsal": rehearsal, "campaign": campaign, "map": surface_map, "comparison": comparison,
             "dataset": dataset, "contact_sheet": contact_sheet}  # fmt: skip


class Plots(unittest.TestCase):
    def setUp(self):
        kept = os.environ.get("NARPA_PLOTS")
        temporary = tempfile.TemporaryDirectory(prefix="narpa-test-")
        self.addCleanup(temporary.cleanup)
        self.folder = Path(kept or temporary.name)
        self.folder.mkdir(exist_ok=True)

    def draw(self, kind, document, name=None):
        several = kind in ("rehearsal", "campaign")
        output = self.folder / (name or kind if several else f"{name or kind}.png")
        return plots.draw({"plot": kind, "title": f"{kind} <&>", **document}, output)

    def test_there_is_a_document_of_every_kind(self):
        self.assertEqual(plots.drawers().keys(), DOCUMENTS.keys())

    def test_every_kind_becomes_a_picture(self):
        for kind, document in DOCUMENTS.items():
            with self.subTest(kind):
                for file in self.draw(kind, document()):
                    self.assertGreater(file.stat().st_size, 3000)
                    if file.suffix == ".svg":
                        self.assertIn("</svg>", file.read_text())

    def test_documents_of_nothing_become_pictures_too(self):
        nothing = {"ladder": {"scenes": []}, "loop": {"runs": []}, "estimates": {"frames": []}, "campaign": campaign(0), "map": surface_map(100.0), "dataset": dataset(0), "contact_sheet": contact_sheet(0),
                   "rehearsal": rehearsal(lockstep=True, flown=False), "comparison": {**comparison(48), "residual_range_dn": 0.0}}  # fmt: skip
        for kind, document in nothing.items():
            with self.subTest(kind):
                self.assertTrue(all(file.exists() for file in self.draw(kind, document, f"{kind}-of-nothing")))

    def test_a_rehearsal_has_the_charts_of_its_page(self):
        names = {file.stem for file in self.draw("rehearsal", rehearsal())}
        self.assertEqual(names, {"above", "side", "front", "contact", "range", "rates", "position_x", "position_y", "position_z",
                                 "attitude_x", "attitude_y", "attitude_z", "latency", "impulses", "delta_v"})  # fmt: skip
        lockstep = {file.stem for file in self.draw("rehearsal", rehearsal(lockstep=True), "lockstep")}
        self.assertEqual(names - lockstep, {"latency"})

    def test_a_landing_has_charts_of_its_own(self):
        limits = {"from_site_m": 4, "vertical_m_s": 1.5, "horizontal_m_s": 0.5, "tilt_deg": 5, "rate_deg_s": 3}
        names = {file.stem for file in self.draw("rehearsal", {**rehearsal(lockstep=True), "landing": limits}, "landing")}
        self.assertEqual(names, {"profile", "track", "height", "velocity", "site", "position_x", "position_y", "position_z",
                                 "attitude_x", "attitude_y", "attitude_z", "impulses", "delta_v"})  # fmt: skip
        nothing = self.draw("rehearsal", {**rehearsal(lockstep=True, flown=False), "landing": limits}, "no-landing")
        self.assertTrue(all(file.exists() for file in nothing))
        run = {"within": True, "position_m": [0, 1, 2], "closing_m_s": 1, "lateral_m_s": 0.1, "tilt_deg": 1, "rate_deg_s": 0.2}
        names = {file.stem for file in self.draw("campaign", {"landing": limits, "runs": [run, {**run, "within": False}]}, "landings")}
        self.assertEqual(names, {"where", "rates", "tilt"})

    def test_a_map_labels_its_lines(self):
        file = self.folder / "map.svg"
        plots.draw({"plot": "map", "title": "a < b", **surface_map()}, file)
        texts = [text.text for text in ElementTree.parse(file).iter("{http://www.w3.org/2000/svg}text")]
        self.assertIn("10", texts)
        self.assertIn("height, m above 1.5", texts)
        self.assertIn("a < b", texts)

    def test_null_stands_for_numbers_that_are_not_finite(self):
        document = estimates()
        document["frames"][3]["position_sigma_m"] = None
        self.draw("estimates", document)


class Program(unittest.TestCase):
    def setUp(self):
        temporary = tempfile.TemporaryDirectory(prefix="narpa-test-")
        self.addCleanup(temporary.cleanup)
        self.folder = Path(temporary.name)

    def run_with(self, text, *arguments, environment=None):
        (self.folder / "a.json").write_text(text)
        return subprocess.run([sys.executable, NARPA_PLOT, self.folder / "a.json", *arguments], capture_output=True, text=True,
                              env={**os.environ, **(environment or {})})  # fmt: skip

    def test_draws_beside_the_document(self):
        done = self.run_with(json.dumps({"plot": "replay", "title": "", **replay()}))
        self.assertEqual((done.returncode, done.stdout, done.stderr), (0, "", ""))
        self.assertEqual((self.folder / "a.png").read_bytes()[:4], b"\x89PNG")

    def test_says_what_is_wrong_with_a_document(self):
        for text, what in (("{", "line 1"), ("[]", '"plot" is None'), ('{"plot": "cake"}', "'cake', expected one of approach"),
                           ('{"plot": "loop"}', "no 'runs'")):  # fmt: skip
            done = self.run_with(text)
            self.assertEqual(done.returncode, 1, text)
            self.assertIn(what, done.stderr)
            self.assertNotIn("Traceback", done.stderr)

    def test_several_charts_need_a_folder(self):
        text = json.dumps({"plot": "rehearsal", "title": "", **rehearsal()})
        for name in ("x.png", "x.svg"):
            done = self.run_with(text, "-o", str(self.folder / name))
            self.assertEqual(done.returncode, 1)
            self.assertRegex(done.stderr, rf"a.json: has \d+ charts, expected a folder for them, not the file .*{name}")
            self.assertFalse((self.folder / name).exists())
        self.assertEqual(self.run_with(text, "-o", str(self.folder / "charts.of.one")).returncode, 0)
        self.assertTrue((self.folder / "charts.of.one/above.svg").exists())

    def test_without_matplotlib_says_how_to_get_it(self):
        (self.folder / "matplotlib.py").write_text("raise ImportError\n")
        done = self.run_with(json.dumps({"plot": "replay", **replay()}), environment={"PYTHONPATH": str(self.folder)})
        self.assertEqual(done.returncode, plots.MATPLOTLIB_MISSING)
        self.assertIn("apt-get install python3-matplotlib && narpa-plot", done.stderr)
        self.assertFalse((self.folder / "a.png").exists())


if __name__ == "__main__":
    unittest.main()
