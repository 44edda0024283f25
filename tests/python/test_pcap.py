"""narpa.pcap: units told apart, losses as warnings, and what is refused. tests/drivers/captures.cpp has the datagrams themselves."""
import struct
import tempfile
import unittest
import warnings

from narpa import pcap


def frame(payload, unit=201, port=2368, fragment=0):
    """A raw IPv4 packet."""
    udp = struct.pack(">4H", 2368, port, 8 + len(payload), 0) + payload
    return struct.pack(">BxHHHBBH", 0x45, 20 + len(udp), 7, fragment, 64, 17, 0) + bytes([192, 168, 1, unit, 255, 255, 255, 255]) + udp


class Captures(unittest.TestCase):
    def file(self, frames, link=101, tail=b""):
        file = tempfile.NamedTemporaryFile(suffix=".pcap")
        self.addCleanup(file.close)
        file.write(struct.pack("<IHHiIII", 0xA1B2C3D4, 2, 4, 0, 0, 65535, link))
        for i, data in enumerate(frames):
            file.write(struct.pack("<4I", 0, i, len(data), len(data)) + data)
        file.write(tail)
        file.flush()
        return file.name

    def test_of_several_units_ask_for_a_choice(self):
        path = self.file([frame(b"a", 201), frame(b"b", 202), frame(b"c", 202, port=2369)])
        packets = lambda unit=None: list(pcap.packets(path, lambda payload: True, unit))  # noqa: E731
        with self.assertRaisesRegex(ValueError, r"3 units: 192\.168\.1\.201:2368, 192\.168\.1\.202:2368, 192\.168\.1\.202:2369"):
            packets()
        self.assertEqual(packets("192.168.1.201"), [b"a"])
        self.assertEqual(packets("192.168.1.202:2369"), [b"c"])
        with self.assertRaisesRegex(ValueError, "2 units"):
            packets("192.168.1.202")

    def test_that_lost_something_warn(self):
        path = self.file([frame(b"a"), frame(b"a"), frame(bytes(8), fragment=0x2000)], tail=b"cut")
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            self.assertEqual(list(pcap.udp_payloads(path)), [b"a"])
        texts = [str(w.message) for w in caught]
        self.assertRegex(texts[0], "cut short, what is whole is used: 3 of 16 bytes")
        self.assertRegex(texts[1], "dropped: 1 incomplete, 1 repeated")

    def test_of_unknown_links_are_refused(self):
        with self.assertRaisesRegex(ValueError, "link type 105, expected Ethernet"):
            pcap.read(self.file([], link=105))


if __name__ == "__main__":
    unittest.main()
