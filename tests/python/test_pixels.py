"""narpa.pixels: arrays of packed and right-justified pixels, against the definitions bit by bit."""
import random
import unittest

import numpy as np

from narpa import pixels


def packed(values, bits):
    """MIPI CSI-2 RAW10 or RAW12, pixel by pixel."""
    group = 4 if bits == 10 else 2
    data = bytearray()
    for first in range(0, len(values), group):
        part = values[first : first + group]
        data += bytes(v >> (bits - 8) for v in part)
        data.append(sum((v & ((1 << (bits - 8)) - 1)) << ((bits - 8) * i) for i, v in enumerate(part)))
    return bytes(data)


class Pixels(unittest.TestCase):
    def test_packed(self):
        for code, bits in pixels.PACKED.items():
            values = [random.Random(code).randrange(1 << bits) for _ in range(24 * 6)]
            data = packed(values, bits)
            self.assertEqual(len(data), 6 * pixels.row_bytes(code, 24), code)
            self.assertEqual(pixels.array(code, 24, 6, data).reshape(-1).tolist(), values, code)

    def test_samples(self):
        self.assertEqual(pixels.array("Y12 ", 2, 1, b"\x34\x02\xff\x0f").tolist(), [[0x234, 0xFFF]])
        self.assertEqual(pixels.array("RGB3", 1, 1, b"\x01\x02\x03").tolist(), [[[1, 2, 3]]])
        self.assertEqual(pixels.row_bytes("YUYV", 10), 20)
        self.assertEqual(pixels.row_bytes("????", 10), 0)
        self.assertEqual(pixels.array("BG14", 2, 2, bytes(8)).dtype, np.dtype("<u2"))


if __name__ == "__main__":
    unittest.main()
