"""narpa.logs: the log of a run, poses, CAN messages, calibration."""
import json
import math
import tempfile
import unittest
from pathlib import Path

import needs

needs.modules("numpy")

import numpy as np
from narpa import logs
from narpa.can import Catalogue


def candump(frames):
    return "".join(f"({t:.6f}) vcan0 {identifier:03X}#{data.hex().upper()}\n" for t, identifier, data in frames)


class Logs(unittest.TestCase):
    def setUp(self):
        self.kept = tempfile.TemporaryDirectory()
        self.folder = Path(self.kept.name)

    def tearDown(self):
        self.kept.cleanup()

    def test_tables_have_a_type_for_each_column(self):
        (self.folder / "run.json").write_text("{}")
        (self.folder / "nav.ledger.csv").write_text("frame,t_exposure_mid_ns,expected_error,delivery,passes\n"
                                                    "0,9007199254740993,0.5,frame,\n1,2000000000,1,nothing,5;7\n")
        ledger = logs.Run(self.folder).ledger("nav")
        self.assertEqual(ledger["t_exposure_mid_ns"].tolist(), [9007199254740993, 2000000000])
        self.assertEqual(ledger["expected_error"].tolist(), [0.5, 1.0])
        self.assertEqual(ledger["delivery"].tolist(), ["frame", "nothing"])
        self.assertEqual(ledger["passes"].tolist(), ["", "5;7"])
        (self.folder / "nav.ledger.csv").write_text("a,b\n1,2\n3\n")
        with self.assertRaisesRegex(ValueError, "nav.ledger.csv:3: 1 columns, expected 2"):
            logs.Run(self.folder).ledger("nav")
        with self.assertRaisesRegex(ValueError, "run.json: no such file"):
            logs.Run(self.folder / "none")

    def test_relative_poses(self):
        h = math.sqrt(0.5)
        (self.folder / "truth.csv").write_text("t_s,body,x_m,y_m,z_m,qw,qx,qy,qz\n"
                                               f"0.1,station,1,2,3,1,0,0,0\n0.1,chaser,1,0,3,{h},0,0,{h}\n")
        poses = logs.Poses(logs.read_table(self.folder / "truth.csv"))
        position, attitude = poses.relative(100_000_000, "station", "chaser")
        np.testing.assert_allclose(position, [2, 0, 0], atol=1e-12)  # the chaser's x is the world's y
        np.testing.assert_allclose(attitude, [h, 0, 0, -h], atol=1e-12)
        self.assertEqual(poses.times_ns(), [100_000_000])
        with self.assertRaises(KeyError):
            poses.at(0, "station")

    def test_messages_of_a_can_log(self):
        frames = Catalogue().at("Pose", 0x100).encode(
            {"Time": 5_000_000, "Position": (1, 2, 3), "Attitude": (1, 0, 0, 0), "Velocity": (0, 0, 0), "Rate": (0, 0, 0)}, 7, False)
        (self.folder / "can.log").write_text(candump([(0.005, identifier, data) for identifier, data in frames]))
        (t_s, message), = logs.messages(self.folder / "can.log")
        self.assertEqual((t_s, message.name), (0.005, "Pose"))
        np.testing.assert_allclose(message.vector("Position"), [1, 2, 3], atol=1e-4)
        (self.folder / "can.log").write_text("(1.0) vcan0 123#00\nhello\n")
        with self.assertRaisesRegex(ValueError, "can.log:2: expected"):
            list(logs.messages(self.folder / "can.log"))

    def test_candump_lines_of_each_form(self):
        (self.folder / "can.log").write_text("(1.5) can0 123#0A0B\n(2.5) can0 12345678##1AABB R\n(3.5) can0 123#R\n(4) can0 7FF#01_8\n")
        self.assertEqual(list(logs.read_candump(self.folder / "can.log")),
                         [(1.5, 0x123, b"\x0a\x0b"), (2.5, 0x12345678, b"\xaa\xbb"), (4.0, 0x7FF, b"\x01")])

    def test_calibration(self):
        h = math.sqrt(0.5)
        camera = {"name": "nav", "mount": "chaser", "position_m": [1, 0, 0], "attitude_wxyz": [h, 0, 0, h],
                  "camera_matrix": [[700, 0, 320], [0, 700, 240], [0, 0, 1]], "distortion_coefficients": [0.1, 0, 0, 0, 0]}
        (self.folder / "calibration.json").write_text(json.dumps({"cameras": [camera], "lidars": []}))
        nav = logs.read_calibration(self.folder / "calibration.json")["nav"]
        np.testing.assert_allclose(nav.from_mount([1, 2, 0]), [2, 0, 0], atol=1e-12)
        self.assertEqual(nav.matrix[0, 2], 320)
        self.assertEqual(nav.distortion[0], 0.1)
        (self.folder / "calibration.json").write_text("{}")
        with self.assertRaisesRegex(ValueError, "calibration.json: expected"):
            logs.read_calibration(self.folder / "calibration.json")

    def test_marks(self):
        lamp = {"name": "top", "body": "station", "kind": "lamp", "position_m": [1, 2, 3], "radius_m": 0.1, "normal": [1, 0, 0]}
        # x right, y up, z out of the image are y, z, x of the body
        tag = {"name": "t", "body": "board", "kind": "tag", "position_m": [1, 0, 0], "attitude_wxyz": [0.5, 0.5, 0.5, 0.5],
               "dictionary": "4X4_50", "id": 7, "side_m": 2}  # fmt: skip
        path = self.folder / "calibration.json"
        path.write_text(json.dumps({"cameras": [], "lidars": [], "marks": [lamp, tag]}))
        self.assertEqual([m.name for m in logs.read_marks(path)], ["top", "t"])
        self.assertEqual([m["radius_m"] for m in logs.read_marks(path, "station")], [0.1])
        np.testing.assert_allclose(logs.read_marks(path, "board")[0].corners_m, [[1, -1, 1], [1, 1, 1], [1, 1, -1], [1, -1, -1]], atol=1e-12)

    def test_calibration_and_marks_of_a_run(self):
        lamp = {"name": "top", "body": "station", "kind": "lamp", "position_m": [1, 2, 3], "radius_m": 0.1}
        nav = {"name": "nav", "mount": "chaser", "position_m": [1, 0, 0], "attitude_wxyz": [1, 0, 0, 0]}
        (self.folder / "run.json").write_text("{}")
        (self.folder / "calibration.json").write_text(json.dumps({"cameras": [nav], "lidars": [], "marks": [lamp]}))
        run = logs.Run(self.folder)
        self.assertEqual(run.calibration()["nav"].mount, "chaser")
        self.assertEqual([m.name for m in run.marks("station")], ["top"])
        self.assertEqual(run.marks("chaser"), [])


if __name__ == "__main__":
    unittest.main()
