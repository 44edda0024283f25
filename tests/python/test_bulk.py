"""narpa.bulk: the test bytes of narpa's own decoder, and streams with corrupted frames."""
import io
import unittest

import needs

needs.modules("numpy")

import numpy as np
from narpa import bulk

# The same bytes as in tests/protocols/video_bulk_frame.cpp.
HEADER = bytes.fromhex("4e52504601003000feffffffffffffff0403020159313620"
                       "80020000e00100000005000000600900443322113f2e0792")  # fmt: skip


def picture(number, shape=(6, 8), kind=np.uint8):
    return np.random.default_rng(number).integers(0, np.iinfo(kind).max, shape, kind)


class Frames(unittest.TestCase):
    def test_the_header_has_the_documented_bytes(self):
        header = bulk.decode(HEADER)
        self.assertEqual(header, (-2, 0x01020304, "Y16 ", 640, 480, 1280, 614400, 0x11223344))
        for bit in range(8 * len(HEADER)):
            bad = bytearray(HEADER)
            bad[bit // 8] ^= 1 << bit % 8
            self.assertIsNone(bulk.decode(bytes(bad)), f"bit {bit}")
        self.assertIsNone(bulk.decode(HEADER[:-1]))

    def test_frames_come_back(self):
        for fourcc, (channels, kind) in bulk.FORMATS.items():
            shape = (6, 8) + ((channels,) if channels > 1 else ())
            pixels = picture(1, shape, np.dtype(kind).type)
            [(header, got)] = bulk.read(io.BytesIO(bulk.encode(pixels, 5, 6, fourcc)))
            np.testing.assert_array_equal(got, pixels)
            self.assertEqual(header[:5], (5, 6, fourcc, 8, 6))

    def test_spoilt_frames_are_passed_over(self):
        frames = [bulk.encode(picture(k), 10 * k, k, "GREY") for k in range(6)]
        spoilt = bytearray(frames[3])
        spoilt[-1] ^= 1
        stream = b"junk" + frames[0] + frames[1][:60] + frames[2] + bytes(spoilt) + b"NRP" + frames[4] + frames[5][:-1]
        got = list(bulk.read(io.BytesIO(stream)))
        self.assertEqual([header.number for header, _ in got], [0, 2, 4])
        for header, pixels in got:
            np.testing.assert_array_equal(pixels, picture(header.number))


if __name__ == "__main__":
    unittest.main()
