"""narpa.datagrams: the test bytes of narpa's own decoder, and streams with lost, late and repeated datagrams."""
import random
import struct
import unittest
import zlib

from narpa import datagrams


def datagram(frame, index, count=4, row_bytes=16, value=None):
    body = bytes([index if value is None else value]) * row_bytes
    head = b"NRPD" + struct.pack("<HHqI4sHHIIIII", 1, 52, frame * 100, frame, b"GREY", row_bytes, count, row_bytes, index, count, index, 0)
    return head + struct.pack("<I", zlib.crc32(body, zlib.crc32(head))) + body


class Decoding(unittest.TestCase):
    def test_header(self):
        header, body = datagrams.decode(datagram(7, 2))
        self.assertEqual((header.frame, header.t_ns, header.index, header.count, header.row), (7, 700, 2, 4, 2))
        self.assertEqual((header.width, header.height, header.format, len(body)), (16, 4, "GREY", 16))

    def test_damaged(self):
        good = datagram(7, 2)
        for at in range(len(good)):
            self.assertIsNone(datagrams.decode(good[:at] + bytes([good[at] ^ 0x40]) + good[at + 1 :]), at)
        self.assertIsNone(datagrams.decode(good[:-1]))
        self.assertIsNone(datagrams.decode(b""))


class Assembling(unittest.TestCase):
    def frames(self, stream):
        assembly = datagrams.Assembly()
        found = [frame for data in stream for frame in assembly.take(data)]
        return assembly, [(f.header.frame, f.lost) for f in found], found

    def test_any_order_within_a_frame(self):
        stream = [datagram(n, i) for n in range(3) for i in random.Random(n).sample(range(4), 4)]
        _, found, frames = self.frames(stream)
        self.assertEqual(found, [(0, 0), (1, 0), (2, 0)])
        for frame in frames:
            self.assertEqual(frame.pixels.tolist(), [[row] * 16 for row in range(4)])

    def test_lost(self):
        stream = [datagram(n, i) for n in range(4) for i in range(4) if (n, i) not in {(1, 2), (1, 3)}]
        _, found, frames = self.frames(stream)
        self.assertEqual(found, [(0, 0), (1, 2), (2, 0), (3, 0)])
        self.assertEqual(frames[1].pixels[2:].max(), 0)

    def test_late_and_twice(self):
        stream = [datagram(0, i) for i in range(3)] + [datagram(1, 0), datagram(1, 0), datagram(0, 3)]
        stream += [datagram(1, i) for i in (1, 2, 3)] + [datagram(0, 0)]
        assembly, found, _ = self.frames(stream)
        self.assertEqual(found, [(0, 0), (1, 0)])
        self.assertEqual(assembly.refused, 2)

    def test_a_sender_that_begins_again_and_a_number_that_wraps(self):
        numbers = [4294967294, 4294967295, 0, 1, 1000, 0, 1]
        _, found, _ = self.frames([datagram(n, i) for n in numbers for i in range(4)])
        self.assertEqual(found, [(n, 0) for n in numbers])


if __name__ == "__main__":
    unittest.main()
