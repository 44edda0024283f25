"""Scene.scan: the shots of `narpa scan -o FILE.csv`."""
import tempfile
import unittest
from pathlib import Path

import needs

needs.compiled()

import narpa
import numpy as np
import program


class Scans(unittest.TestCase):
    def shots_of_the_program(self, *options):
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "shots.csv"
            program.narpa("scan", program.SCENE, "-o", path, *options)
            return np.genfromtxt(path, delimiter=",", names=True, dtype=None, encoding=None)

    def test_all_columns_are_those_of_the_program(self):
        scene = narpa.load_scene(program.SCENE)
        scene.place("chaser", *program.POSE)
        for _ in range(2):  # again, with the same unit
            shots = scene.scan("top", 0.25)
            expected = self.shots_of_the_program("--time", "0.25", "--pose", program.pose_option("chaser", program.POSE))
            self.assertEqual(shots.dtype.names, expected.dtype.names)
            self.assertEqual(len(shots), len(expected))
            self.assertGreater((shots["reported_range_m"] > 0).sum(), 1000)
            for name in shots.dtype.names:
                # The file has the shortest digits that give the same float or double back.
                np.testing.assert_array_equal(shots[name], expected[name].astype(shots[name].dtype), name)

    def test_a_duration_is_kept(self):
        scene = narpa.load_scene(program.SCENE)
        turn, half = scene.scan(), scene.scan(duration_s=0.05)
        self.assertAlmostEqual(len(turn) / len(half), 2, delta=0.1)
        np.testing.assert_array_equal(turn[:len(half)], half)
        with self.assertRaisesRegex(narpa.Error, "duration -1"):
            scene.scan(duration_s=-1)


if __name__ == "__main__":
    unittest.main()
