"""narpa.rtp: packets worked out from RFC 4175, the groups of pixels of each depth, and streams with lost packets."""
import struct
import unittest

from narpa import rtp

SDP = ("v=0\r\no=- 0 0 IN IP4 10.0.0.1\r\ns=x\r\nc=IN IP4 239.1.2.3/4\r\nt=0 0\r\nm=video 5004 RTP/AVP 96\r\na=rtpmap:96 raw/90000\r\n"
       "a=fmtp:96 sampling={}; width={}; height={}; depth={}; colorimetry=BT601-5\r\n")  # fmt: skip


def session(sampling="YCbCr-4:2:2", width=4, height=2, depth=8):
    return rtp.read_sdp(SDP.format(sampling, width, height, depth))


def packet(rows, ticks=9, is_last=True, number=7, sequence=0, marker_type=96):
    """`rows`: row, offset, bytes."""
    head = bytes([0x90, (128 if is_last else 0) | marker_type]) + struct.pack(">HII", sequence & 0xFFFF, ticks, 1)
    head += struct.pack(">HHBqIxxx", 0xBEDE, 4, 0x1B, ticks * 100, number) + struct.pack(">H", sequence >> 16)
    for k, (row, offset, data) in enumerate(rows):
        head += struct.pack(">HHH", len(data), row, offset | (0x8000 if k + 1 < len(rows) else 0))
    return head + b"".join(data for _, _, data in rows)


def grey(*values):
    return b"".join(bytes([128, v]) for v in values)


class Sessions(unittest.TestCase):
    def test_sdp(self):
        s = session(depth=10)
        self.assertEqual((s.address, s.port, s.payload_type, s.width, s.height, s.depth), ("239.1.2.3", 5004, 96, 4, 2, 10))
        self.assertEqual(s.group, (2, 5))

    def test_others_are_refused(self):
        for text in ("", SDP.replace("raw/90000", "H264/90000"), SDP.format("YCbCr-4:2:0", 4, 2, 8), SDP.format("RGB", 4, 2, 10)):
            with self.assertRaises(ValueError):
                rtp.read_sdp(text)


class Decoding(unittest.TestCase):
    def test_header(self):
        p = rtp.decode(packet([(0, 0, grey(1, 2, 3, 4)), (1, 2, grey(5, 6))], sequence=0x12345), session())
        self.assertEqual((p.sequence, p.is_last, p.timestamp, p.frame, p.t_ns), (0x12345, True, 9, 7, 900))
        self.assertEqual(p.parts, [(0, 0, grey(1, 2, 3, 4)), (1, 2, grey(5, 6))])

    def test_damaged(self):
        good = packet([(0, 0, grey(1, 2, 3, 4))])
        for size in range(len(good)):
            self.assertIsNone(rtp.decode(good[:size], session()), size)
        for bad in (packet([(2, 0, grey(1, 2))]), packet([(0, 1, grey(1, 2))]), packet([(0, 4, grey(1, 2))]),
                    packet([(0, 0, b"123")]), packet([(0, 0, grey(1, 2))], marker_type=97)):  # fmt: skip
            self.assertIsNone(rtp.decode(bad, session()))

    def test_groups_of_each_depth(self):
        # Cb and Cr in the middle, Y0 and Y1 the high bits of 0xABC1 and 0x1232
        groups = {8: bytes([128, 0xAB, 128, 0x12]), 10: bytes([0x80, 0x2A, 0xF8, 0x00, 0x48]),
                  12: bytes([0x80, 0x0A, 0xBC, 0x80, 0x01, 0x23]), 16: bytes([0x80, 0, 0xAB, 0xC1, 0x80, 0, 0x12, 0x32])}  # fmt: skip
        for depth, group in groups.items():
            (frame,) = rtp.Assembly(session(width=2, height=1, depth=depth)).take(packet([(0, 0, group)]))
            self.assertEqual(frame.planes.tolist(), [[0xABC1 >> (16 - depth), 0x1232 >> (16 - depth)]])
            self.assertEqual(frame.chroma.tolist(), [[[1 << (depth - 1)] * 2]])
        (frame,) = rtp.Assembly(session("RGB", width=1, height=1)).take(packet([(0, 0, b"\1\2\3")]))
        self.assertEqual(frame.planes.tolist(), [[[1, 2, 3]]])


class Assembling(unittest.TestCase):
    def frames(self, packets):
        assembly = rtp.Assembly(session())
        return assembly, [f for data in packets for f in assembly.take(data)]

    def test_any_order_within_a_frame(self):
        rows = [packet([(1, 0, grey(5, 6, 7, 8))]), packet([(0, 2, grey(3, 4))], is_last=False), packet([(0, 0, grey(1, 2))], is_last=False)]
        _, (frame,) = self.frames(rows)
        self.assertEqual(frame.planes.tolist(), [[1, 2, 3, 4], [5, 6, 7, 8]])
        self.assertEqual((frame.number, frame.t_ns, frame.timestamp, frame.came.all()), (7, 900, 9, True))

    def test_lost_and_late(self):
        half, rest = packet([(0, 0, grey(1, 2, 3, 4))], is_last=False), packet([(1, 0, grey(1, 2, 3, 4))])
        whole = [packet([(r, 0, grey(9, 9, 9, 9)) for r in (0, 1)], ticks=9009, number=8)]
        assembly, (first, second) = self.frames([half, *whole, rest, *whole])
        self.assertEqual((first.number, first.came.tolist()), (7, [[True] * 4, [False] * 4]))
        self.assertEqual(first.planes[1].tolist(), [0] * 4)
        self.assertEqual((second.number, second.came.all()), (8, True))
        self.assertEqual(assembly.refused, 2)

    def test_a_sender_that_begins_again(self):
        both = [(r, 0, grey(1, 2, 3, 4)) for r in (0, 1)]
        _, found = self.frames([packet(both, ticks, number=n) for n, ticks in ((0, 900_000), (1, 909_000), (0, 9), (1, 9009))])
        self.assertEqual([f.number for f in found], [0, 1, 0, 1])


if __name__ == "__main__":
    unittest.main()
