"""narpa.ouster: fields of recorded packets, compared with the digests of Ouster's own decoder, and geometry."""
import hashlib
import json
import math
import sys
import unittest
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))
import needs

needs.modules("numpy")
import numpy as np

from narpa import ouster

RECORDINGS = Path(__file__).resolve().parents[3] / "shared/assets/lidar/ouster"
METADATA = {
    "beam_altitude_angles": [30, -30], "beam_azimuth_angles": [90, 0], "lidar_origin_to_beam_origin_mm": 100,
    "lidar_to_sensor_transform": [-1, 0, 0, 0, 0, -1, 0, 0, 0, 0, 1, 50, 0, 0, 0, 1], "lidar_mode": "512x10",
    "data_format": {"udp_profile_lidar": "RNG19_RFL8_SIG16_NIR16"},
}  # fmt: skip


def md5(values, kind):
    """The MD5 of values in the digests' order: beams before columns."""
    return hashlib.md5(np.ascontiguousarray(values.astype(kind)).tobytes()).hexdigest()


class Recordings(unittest.TestCase):
    def check(self, name, fields):
        if not RECORDINGS.is_dir():
            self.skipTest(f"no recordings beside the project: {RECORDINGS}")
        sensor = ouster.Sensor(RECORDINGS / f"{name}.json")
        packets = [sensor.packet(data) for data in sensor.read_pcap(RECORDINGS / f"{name}.pcap")]
        self.assertEqual(len(packets), 64)
        digest = json.loads((RECORDINGS / f"{name}_digest.json").read_text())["packet_hash"]
        for key, field, kind in fields:
            values = np.array([p.fields[field].T for p in packets])
            self.assertEqual(md5(values, kind), digest[key], f"{name}: {field}")
        self.assertEqual(md5(np.array([p.t_ns for p in packets]), "<u8"), digest["TIMESTAMP"])
        self.assertEqual(md5(np.array([p.column for p in packets]), "<u2"), digest["MEASUREMENT_ID"])
        for p in packets:
            self.assertEqual((p.init_id, p.serial), (sensor.init_id, sensor.serial))

    def test_dual_returns(self):
        second = [(key + "2", field + "2", kind) for key, field, kind in (("RANGE", "range", "<u4"), ("FLAGS", "flags", "u1"),
                  ("REFLECTIVITY", "reflectivity", "u1"), ("SIGNAL", "signal", "<u2"))]  # fmt: skip
        self.check("OS-0-32-U1_v2.2.0_1024x10", second + [("RANGE", "range", "<u4"), ("FLAGS", "flags", "u1"), ("NEAR_IR", "near_ir", "<u2"),
                   ("REFLECTIVITY", "reflectivity", "u1"), ("SIGNAL", "signal", "<u2")])  # fmt: skip

    def test_low_bandwidth(self):
        self.check("OS-0-128-U1_v2.3.0_1024x10", [("RANGE", "range", "<u4"), ("FLAGS", "flags", "u1"), ("NEAR_IR", "near_ir", "<u2"),
                   ("REFLECTIVITY", "reflectivity", "u1")])  # fmt: skip


class Geometry(unittest.TestCase):
    def test_of_the_makers_formula_by_hand(self):
        sensor = ouster.Sensor(METADATA)
        # Column 0 points along the lidar's x, 0.1 m from the axis. The first beam is rotated by -90 deg from there, to -y, and 30 deg up.
        points = sensor.positions(np.array([0, 128]), np.full((2, 2), 2100.0))
        up, out = 2 * math.sin(math.radians(30)), 2 * math.cos(math.radians(30))
        expected = [[(-0.1, out, 0.05 + up), (-0.1 - out, 0, 0.05 - up)],
                    [(out, 0.1, 0.05 + up), (0, 0.1 + out, 0.05 - up)]]  # fmt: skip
        np.testing.assert_allclose(points, expected, atol=1e-12)

    def test_refuses_other_packets(self):
        sensor = ouster.Sensor(METADATA)
        good = bytearray(32 + 16 * (12 + 2 * 12) + 32)
        good[0] = 1
        self.assertEqual(len(sensor.decode(good)), 0)
        with self.assertRaisesRegex(ValueError, "a packet of 639 bytes, expected 640"):
            sensor.decode(good[:-1])
        good[0] = 2
        with self.assertRaisesRegex(ValueError, "of type 2, expected 1"):
            sensor.decode(good)


if __name__ == "__main__":
    unittest.main()
