"""narpa.y4m: written frames are read back from files and FIFOs; the headers that narpa writes are read."""
import os
import tempfile
import threading
import unittest

import needs

needs.modules("numpy")

import numpy as np
from narpa import y4m


class Video(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory(prefix="narpa-test-")
        self.addCleanup(self.folder.cleanup)
        self.path = self.folder.name + "/a.y4m"

    def written(self, data):
        with open(self.path, "wb") as file:
            file.write(data)
        return y4m.Reader(self.path)

    def test_frames_come_back(self):
        for bits, kind in ((8, np.uint8), (16, np.uint16)):
            frames = [np.arange(12, dtype=kind).reshape(3, 4) * k for k in (1, 2, 20)]
            writer = y4m.Writer(self.path, 4, 3, 10, bits)
            for frame in frames:
                writer.write(frame)
            writer.close()
            reader = y4m.Reader(self.path)
            for got, wanted in zip(reader, frames, strict=True):
                np.testing.assert_array_equal(got, wanted)
            self.assertEqual((reader.width, reader.height, reader.period_s), (4, 3, 0.1))

    def test_reads_the_headers_that_narpa_writes(self):
        reader = self.written(b"YUV4MPEG2 W2 H1 F1000000000:16666667 Ip A1:1 C422\nFRAME\n\x01\x02\x03\x04")
        self.assertEqual(reader.read_bytes(), b"\x01\x02\x03\x04")
        self.assertAlmostEqual(reader.period_s, 1 / 60, delta=1e-9)
        self.assertIsNone(reader.read_bytes())

    def test_a_frame_that_is_cut_off_is_none(self):
        self.assertIsNone(self.written(b"YUV4MPEG2 W2 H2 F1:1 Cmono\nFRAME\n\x01").read())

    def test_another_stream_may_follow(self):
        data = b"YUV4MPEG2 W2 H1 F1:1 Cmono\nFRAME\n\x01\x02YUV4MPEG2 W1 H3 F1:1 Cmono\nFRAME\n\x03\x04\x05"
        self.assertEqual([frame.tolist() for frame in self.written(data)], [[[1, 2]], [[3], [4], [5]]])

    def test_errors_say_what_was_expected(self):
        for data, what in ((b"P5 64 48\n", "YUV4MPEG2"), (b"YUV4MPEG2 W2 H2 Cstrange\n", "Cstrange frames"),
                           (b"YUV4MPEG2 W2 H1 F1:1 C422\nFRAME\n\x01\x02\x03\x04", "read_bytes"),
                           (b"YUV4MPEG2 W2 H1 F1:1 Cmono\nframe\n\x01\x02", "begin with FRAME")):  # fmt: skip
            with self.assertRaisesRegex(ValueError, what):
                self.written(data).read()
        with self.assertRaisesRegex(ValueError, "expected"):
            y4m.Writer(self.path, 4, 3, 10).write(np.zeros((2, 2)))

    def test_a_fifo_carries_frames(self):
        os.mkfifo(self.path)
        reader = y4m.Reader(self.path)
        writer = y4m.Writer(self.path, 320, 240, 1)  # each frame is larger than the buffer of a FIFO
        frame = np.random.default_rng(1).integers(0, 255, (240, 320), np.uint8)
        thread = threading.Thread(target=writer.write, args=[frame])
        thread.start()
        np.testing.assert_array_equal(reader.read(), frame)
        thread.join()


if __name__ == "__main__":
    unittest.main()
