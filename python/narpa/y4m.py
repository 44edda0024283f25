"""YUV4MPEG2 ("Y4M") video, the format of `narpa run --video CAMERA=FILE.y4m` and of its FIFOs.

Frames are NumPy arrays: height x width of uint8 (Cmono) or uint16 (Cmono16; Cmono10 and Cmono12, whose values are
right-justified). Colour streams are not read as arrays:
`Reader.read_bytes` returns the samples of a frame in stored order (C422: Y, U and V planes of YUYV cameras).
"""
import os
import re
import stat

import numpy as np

SAMPLES = {"mono": 1, "mono10": 2, "mono12": 2, "mono16": 2, "422": 2, "444": 3, "420": 1.5, "420jpeg": 1.5}  # bytes per pixel


class Reader:
    """Iterates over the frames of a file or a FIFO. Opening a FIFO does not wait for its writer."""

    def __init__(self, path):
        # Opened for reading and writing, a FIFO neither waits for a writer nor ends between two writers.
        self.file = os.fdopen(os.open(path, os.O_RDWR if is_fifo(path) else os.O_RDONLY), "rb")
        self.width = self.height = self.colour = self.period_s = None  # known with the first frame

    def read_header(self, line):
        line = line.decode("ascii", "replace").split()
        if line[:1] != ["YUV4MPEG2"]:
            raise ValueError(f"{self.file.name}: not a Y4M stream: it does not begin with YUV4MPEG2")
        fields = {word[0]: word[1:] for word in line[1:]}
        self.width, self.height, self.colour = int(fields["W"]), int(fields["H"]), fields.get("C", "420")
        if match := re.fullmatch(r"(\d+):(\d+)", fields.get("F", "")):
            self.period_s = int(match[2]) / int(match[1])
        if self.colour not in SAMPLES:
            raise ValueError(f"the stream has C{self.colour} frames, expected one of {', '.join('C' + c for c in SAMPLES)}")

    def read_bytes(self):
        """The samples of the next frame; None at the end of the stream. Each writer of a FIFO begins with a header."""
        line = self.file.readline()
        if line and (self.width is None or line.startswith(b"YUV4MPEG2")):
            self.read_header(line)
            line = self.file.readline()
        if not line:
            return None
        if not line.startswith(b"FRAME"):
            raise ValueError(f"{self.file.name}: a frame does not begin with FRAME")
        size = int(self.width * self.height * SAMPLES[self.colour])
        data = self.file.read(size)
        return data if len(data) == size else None

    def read(self):
        """The next frame as an array; None at the end of the stream."""
        data = self.read_bytes()
        if data is None:
            return None
        if not self.colour.startswith("mono"):
            raise ValueError(f"the stream has C{self.colour} frames, expected Cmono, Cmono10, Cmono12 or Cmono16; read_bytes reads them")
        return np.frombuffer(data, np.uint8 if self.colour == "mono" else "<u2").reshape(self.height, self.width)

    def __iter__(self):
        while (frame := self.read()) is not None:
            yield frame

    def close(self):
        self.file.close()


class Writer:
    """Writes grey frames to a file or a FIFO. Opening a FIFO waits for its reader."""

    def __init__(self, path, width, height, rate_hz, bits=8):
        self.shape, self.kind = (height, width), np.dtype(np.uint8 if bits == 8 else "<u2")
        self.file = open(path, "wb", buffering=0)
        numerator, denominator = (rate_hz, 1) if rate_hz == int(rate_hz) else (round(rate_hz * 1e6), 1_000_000)
        self._write(b"YUV4MPEG2 W%d H%d F%d:%d Ip A1:1 C%s\n"
                    % (width, height, numerator, denominator, b"mono" if bits == 8 else b"mono16"))  # fmt: skip

    def write(self, frame):
        """Raises BrokenPipeError if the reader of a FIFO has closed it."""
        frame = np.ascontiguousarray(frame, self.kind)
        if frame.shape != self.shape:
            raise ValueError(f"a frame of {frame.shape}, expected {self.shape}")
        self._write(b"FRAME\n" + frame.tobytes())

    def _write(self, data):
        while data:
            data = data[self.file.write(data) :]

    def close(self):
        self.file.close()


def is_fifo(path):
    return stat.S_ISFIFO(os.stat(path).st_mode)
