"""The scripts of bench/ that compare narpa with other renderers and measure how its cost grows: they run on tiny scenes."""
import importlib
import json
import math
import shutil
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

import needs

needs.compiled()
needs.modules("cv2", "matplotlib")

import narpa
import numpy as np

BENCH = Path(__file__).resolve().parents[2] / "bench"
BUILD = Path(narpa.__file__).parents[2]  # not resolved: the modules are links to the sources
sys.path.insert(0, str(BENCH))
scenes = importlib.import_module("beside.scenes")
peers = importlib.import_module("peers")
cost_laws = importlib.import_module("cost_laws")


def run(script, *arguments):
    """Exit status, standard error and the JSON document of a quick run."""
    with tempfile.TemporaryDirectory() as folder:
        found, picture = Path(folder) / "found.json", Path(folder) / "found.png"
        done = subprocess.run([sys.executable, BENCH / script, "--quick", "--build", BUILD, "--json", found, "--plot", picture, *arguments],
                              capture_output=True, text=True)  # fmt: skip
        assert picture.exists() == found.exists(), done.stderr
        return done.returncode, done.stderr, json.loads(found.read_text()) if found.exists() else None


class Peers(unittest.TestCase):
    def test_the_sphere_of_the_scenes_is_closed_and_faces_outwards(self):
        vertices, faces = scenes.icosphere(3)
        corners = vertices[faces]
        volume = np.linalg.det(corners).sum() / 6
        self.assertAlmostEqual(volume, 4 / 3 * math.pi, delta=0.05)
        self.assertEqual(len(vertices), len(faces) // 2 + 2)

    def test_time_for_an_error_is_interpolated_in_logarithms(self):
        rows = [{"rmse_percent": 8.0, "cpu_s": 1.0}, {"rmse_percent": 2.0, "cpu_s": 16.0}]
        self.assertAlmostEqual(peers.time_at(rows, 4.0, "cpu_s"), 4.0)
        self.assertIsNone(peers.time_at(rows, 9.0, "cpu_s"))

    def test_a_rung_that_a_cheaper_one_beats_does_not_count(self):
        rows = [{"rmse_percent": e, "cpu_s": t} for e, t in ((8.0, 1.0), (20.0, 3.0), (2.0, 16.0))]
        self.assertAlmostEqual(peers.time_at(rows, 4.0, "cpu_s"), 4.0)
        self.assertIsNone(peers.time_at(rows, 9.0, "cpu_s"))

    def test_the_converged_images_of_cycles_and_narpa_agree(self):
        if not shutil.which("blender"):
            self.skipTest("no blender")
        status, errors, found = run("peers.py", "--scenes", "cornell")
        self.assertEqual(status, 0, errors)
        self.assertLess(abs(found["mean_difference_percent"]["cornell"]["Cycles"][0]), 5)  # of few samples
        self.assertEqual({row["program"] for row in found["rows"]}, {"narpa", "Cycles"})


class CostLaws(unittest.TestCase):
    def test_exponents_are_those_of_the_last_tenfold(self):
        rows = [{"n": n, "size": n, "cost": max(50.0, 0.01 * n**2)} for n in (1, 10, 100, 1000)]
        self.assertAlmostEqual(cost_laws.exponents(rows)["cost"], 2)

    def test_every_law_finds_costs(self):
        status, errors, found = run("cost_laws.py", "bodies", "lights", "pixels")
        self.assertEqual(status, 0, errors)
        for name, rows in found.items():
            self.assertEqual([row["n"] for row in rows], cost_laws.LAWS[name][1])
            self.assertTrue(all(math.isfinite(value) for row in rows for value in row.values()), rows)
        self.assertGreater(found["pixels"][0]["memory, MB"], 1)


if __name__ == "__main__":
    unittest.main()
