"""The scripts of bench/ in Python: they run on tiny scenes."""
import importlib
import json
import math
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

import needs

needs.compiled()
needs.modules("matplotlib")

import narpa

BENCH = Path(__file__).resolve().parents[2] / "bench"
BUILD = Path(narpa.__file__).parents[2]  # not resolved: the modules are links to the sources
sys.path.insert(0, str(BENCH))
cost_laws = importlib.import_module("cost_laws")


def run(script, *arguments):
    """Exit status, standard error and the JSON document of a quick run."""
    with tempfile.TemporaryDirectory() as folder:
        found, picture = Path(folder) / "found.json", Path(folder) / "found.png"
        done = subprocess.run([sys.executable, BENCH / script, "--quick", "--build", BUILD, "--json", found, "--plot", picture, *arguments],
                              capture_output=True, text=True)  # fmt: skip
        assert picture.exists() == found.exists(), done.stderr
        return done.returncode, done.stderr, json.loads(found.read_text()) if found.exists() else None


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
