"""narpa.estimate: the document of `narpa estimate`, from arrays."""
import tempfile
import unittest
from pathlib import Path

import needs

needs.compiled()

import narpa
import numpy as np
import program
from narpa import pcap

POSE = (20, 0.5, -0.4), (0, 0, 0, 1)  # of the chaser in the scene docking
SMALL = {"camera.nav.resolution": [160, 128]}


class Estimates(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.scene = narpa.load_scene("docking", SMALL)
        cls.scene.place("chaser", *POSE)
        cls.kept = tempfile.TemporaryDirectory()
        cls.folder = Path(cls.kept.name)
        cls.options = ["--set", "camera.nav.resolution=[160, 128]", "--pose", program.pose_option("chaser", POSE)]

    @classmethod
    def tearDownClass(cls):
        cls.kept.cleanup()

    def same(self, document, of_the_program):
        """Both have the same values; the program's has some of its files too."""
        self.assertEqual({key: of_the_program[key] for key in document}, document)

    def test_of_a_frame_is_that_of_the_program(self):
        frame = self.folder / "frame.raw"
        program.narpa("render", "docking", *self.options, "--spp", "4", "-o", frame)
        expected = program.narpa("estimate", "docking", *self.options, "--frame", frame, "--method", "dense", "--json")
        found = narpa.estimate(self.scene, "nav", self.scene.render("nav", spp=4).dn)
        self.same(found.document, expected)
        self.assertEqual(found.answer, "good", found.why)
        self.assertEqual((found.pose.shape, found.covariance.shape, found.bound.shape), ((4, 4), (6, 6), (6, 6)))
        truth = np.linalg.inv(self.scene.camera_pose("nav")) @ self.scene.pose(found.document["target"])
        self.assertAlmostEqual(np.linalg.norm(found.pose[:3, 3] - truth[:3, 3]), found.error_position_m, delta=1e-9)
        self.assertLess(found.error_position_m, 0.1)

    def test_starts_from_a_guess(self):
        frame = self.scene.render("nav", spp=4)
        truth = np.linalg.inv(self.scene.camera_pose("nav")) @ self.scene.pose("station")
        guess = truth.copy()
        guess[:3, 3] += (0.1, -0.05, 0.3)
        found = narpa.estimate(self.scene, "nav", frame.dn, guess=guess, target="station")
        self.assertTrue(found.passed, found.why)
        self.assertIsNone(found.error_position_m)
        np.testing.assert_allclose(found.document["guess"]["position_m"], guess[:3, 3])
        self.assertLess(np.linalg.norm(found.pose[:3, 3] - truth[:3, 3]), 0.1)

    def test_of_a_sweep_is_that_of_the_program(self):
        sweep = self.folder / "sweep.pcap"
        program.narpa("scan", "docking", *self.options, "-o", sweep)
        expected = program.narpa("estimate", "docking", *self.options, "--sweep", sweep, "--target", "station", "--json")
        packets = [payload for payload in pcap.udp_payloads(sweep) if len(payload) == 1206]
        found = narpa.estimate(self.scene, "top", packets, target="station")
        self.same(found.document, expected)
        self.assertTrue(found.passed, found.why)
        # The same from the shots before the packets round them, 2 mm.
        of_shots = narpa.estimate(self.scene, "top", self.scene.scan("top"), target="station")
        self.assertTrue(of_shots.passed, of_shots.why)
        self.assertLess(np.linalg.norm(of_shots.pose[:3, 3] - found.pose[:3, 3]), 0.02)

    def test_what_cannot_be_estimated_is_an_error(self):
        frame = self.scene.render("nav").dn
        for wrong, expected in (
            (lambda: narpa.estimate(self.scene, "nav", frame[:-1]), r"\(127, 160\) .*expected \(128, 160\)"),
            (lambda: narpa.estimate(self.scene, "nav", frame.astype(float)), "float64"),
            (lambda: narpa.estimate(self.scene, "nav", frame, method="sense"), "dense"),
            (lambda: narpa.estimate(self.scene, "nav", frame, target="moon"), "moon"),
            (lambda: narpa.estimate(self.scene, "nav", frame, uncertainty={"size": 1}), "scale"),
            (lambda: narpa.estimate(self.scene, "nav", frame, start="near"), "search"),
            (lambda: narpa.estimate(self.scene, "top", [b"x"]), "1206 bytes"),
            (lambda: narpa.estimate(self.scene, "top", np.zeros(3)), "Scene.scan"),
        ):
            with self.assertRaisesRegex(narpa.Error, expected):
                wrong()
        black = narpa.estimate(self.scene, "nav", np.zeros_like(frame))
        self.assertEqual((black.passed, black.answer, black.pose), (False, "refused", None))
        self.assertTrue(black.why)


if __name__ == "__main__":
    unittest.main()
