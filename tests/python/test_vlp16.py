"""narpa.vlp16: packets as the VLP-16's manual (63-9243 Rev. D) describes them, and captures of them."""
import os
import socket
import struct
import tempfile
import threading
import time
import unittest
from pathlib import Path

import needs

needs.modules("numpy")

import numpy as np
from narpa import vlp16

AZIMUTHS = (350 + 0.4 * np.arange(12)) % 360  # deg: crosses 0 within the packet


def free_port():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as s:
        s.bind(("127.0.0.1", 0))
        return s.getsockname()[1]


def packet(ranges, t_s=12.5):
    return vlp16.encode(AZIMUTHS, ranges, reflectivities=40, t_s=t_s)


class Packets(unittest.TestCase):
    def test_have_the_bytes_of_the_manual(self):
        ranges = np.zeros((24, 16))
        ranges[0, 3] = 5.0
        data = packet(ranges)
        self.assertEqual(len(data), 1206)
        self.assertEqual(data[:4], b"\xff\xee" + struct.pack("<H", 35000))
        self.assertEqual(data[4 + 3 * 3 : 4 + 3 * 4], struct.pack("<HB", 2500, 40))
        self.assertEqual(data[1200:], struct.pack("<I", 12_500_000) + b"\x37\x22")

    def test_points_lie_where_laser_and_rotor_point(self):
        ranges = np.zeros((24, 16))
        ranges[4, 15], ranges[23, 0] = 10.0, 20.0
        first, second = vlp16.decode(packet(ranges))
        # Sequence 4 begins block 2. Laser 15 fires 15 * 2.304 us later; the rotor turns 0.4 degrees in 110.592 us.
        azimuth, elevation = np.radians(350.8 + 0.4 * 15 * 2.304 / 110.592), np.radians(15)
        expected = 10 * np.array([np.cos(elevation) * np.sin(azimuth), np.cos(elevation) * np.cos(azimuth), np.sin(elevation)])
        np.testing.assert_allclose(first["position_m"], expected + [0, 0, -0.0112], atol=1e-9)
        self.assertAlmostEqual(second["azimuth_rad"], np.radians((350 + 0.4 * 11.5) % 360), places=9)
        self.assertEqual((first["laser"], second["laser"], second["reflectivity"]), (15, 0, 40))
        self.assertAlmostEqual(second["t_s"], 12.5 + 23 * 55.296e-6, places=9)

    def test_shots_without_a_return_are_left_out(self):
        self.assertEqual(len(vlp16.decode(packet(np.zeros((24, 16))))), 0)
        self.assertEqual(len(vlp16.decode(packet(np.full((24, 16), 140.0)))), 0, "beyond what a packet can say")
        self.assertEqual(len(vlp16.decode(packet(np.full((24, 16), 3.0)))), 384)

    def test_a_shot_without_a_return_has_the_reflectivity_that_narpa_writes(self):
        self.assertEqual(packet(np.zeros((24, 16)))[4:7], b"\0\0\xff")

    def test_errors_say_what_was_expected(self):
        good = packet(np.zeros((24, 16)))
        for bad, what in ((b"", "expected 1206"), (b"\0" + good[1:], "FF EE"), (good[:-1] + b"\x21", "0x21, expected 0x22"),
                          (good[:-2] + b"\x39\x22", "0x39, expected one return")):  # fmt: skip
            with self.assertRaisesRegex(ValueError, what):
                vlp16.decode(bad)

    def test_a_second_of_packets_waits_for_the_reader(self):
        limit = int(Path("/proc/sys/net/core/rmem_max").read_text())
        if os.geteuid() != 0 and limit < 1 << 20:
            self.skipTest(f"net.core.rmem_max is {limit}, and only root may exceed it")
        port = free_port()
        packets = vlp16.receive(port, "127.0.0.1", timeout_s=0.2)
        self.assertEqual(list(packets), [])  # the socket is bound at the first read
        packets = vlp16.receive(port, "127.0.0.1", timeout_s=5)
        data = packet(np.zeros((24, 16)))
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as s:
            threading.Timer(0.5, lambda: [s.sendto(data, ("127.0.0.1", port)) for _ in range(755)]).start()
            next(packets)
            time.sleep(1)
            self.assertEqual([next(packets) for _ in range(754)], 754 * [data])

    def test_arrive_over_udp(self):
        port = free_port()
        packets = vlp16.receive(port, "127.0.0.1", timeout_s=0.2)
        self.assertEqual(list(packets), [])

    def test_of_a_limited_field_of_view_spread_no_block_over_the_gap(self):
        azimuths = np.arange(12) * 0.4 + np.where(np.arange(12) < 5, 88.6, 236.0)
        points = vlp16.decode(vlp16.encode(azimuths, np.full((24, 16), 3.0)))
        off = np.degrees(points["azimuth_rad"]).reshape(12, 32) - azimuths[:, None]
        self.assertTrue((off >= -0.006).all() and (off < 0.4).all(), off)

    def test_are_read_from_captures(self):
        data = packet(np.full((24, 16), 3.0))
        udp = struct.pack(">4H", 2368, 2368, 8 + len(data), 0) + data
        ip = bytes([0x45, 0]) + struct.pack(">H", 20 + len(udp)) + bytes(5) + b"\x11" + bytes(10)
        frames = [bytes(12) + b"\x08\x00" + ip + udp, bytes(12) + b"\x08\x06" + bytes(30)]  # the second is ARP
        with tempfile.NamedTemporaryFile() as file:
            file.write(struct.pack("<IHHiIII", 0xA1B2C3D4, 2, 4, 0, 0, 65535, 1))
            for frame in frames:
                file.write(struct.pack("<4I", 0, 0, len(frame), len(frame)) + frame)
            file.flush()
            self.assertEqual(list(vlp16.read_pcap(file.name)), [data])
        with tempfile.NamedTemporaryFile() as file, self.assertRaisesRegex(ValueError, "not a pcap file"):
            list(vlp16.read_pcap(file.name))


if __name__ == "__main__":
    unittest.main()
