"""Frames as `narpa run --video CAMERA=bulk:` sends them to a USB frame bridge, for example an FPGA or FX3.

The format is defined in protocols/video/README.md. `read` reads a stream that a bridge forwards to its host, or a recording
of it. Truncated and corrupted frames are skipped.
"""
import struct
import zlib
from typing import NamedTuple

import numpy as np

from . import pixels as pixel_formats
from .pixels import FORMATS

MAGIC, VERSION, HEADER_BYTES = b"NRPF", 1, 48


class Header(NamedTuple):
    t_ns: int  # mid-exposure, simulation clock
    number: int
    format: str  # V4L2 fourcc
    width: int
    height: int
    row_bytes: int
    size: int  # bytes after the header
    crc: int  # CRC-32 of these bytes


def decode(data):
    """Decodes the header in the first 48 bytes; None if they are not a valid header."""
    if len(data) < HEADER_BYTES or data[:4] != MAGIC:
        return None
    version, length, t_ns, number, fourcc, *sizes, crc = struct.unpack_from("<HHqI4s5II", data, 4)
    header = Header(t_ns, number, fourcc.decode("latin-1"), *sizes)
    row = pixel_formats.row_bytes(header.format, header.width)
    good = (version, length, crc) == (VERSION, HEADER_BYTES, zlib.crc32(data[: HEADER_BYTES - 4]))
    fits = 0 < row <= header.row_bytes
    return header if good and fits and header.row_bytes * header.height == header.size > 0 else None


def encode(pixels, t_ns, number, fourcc):
    """Header and pixels of an array of height x width, or height x width x channels."""
    channels, kind = FORMATS[fourcc]
    pixels = np.ascontiguousarray(pixels, kind)
    height, width = pixels.shape[:2]
    data = pixels.tobytes()
    head = MAGIC + struct.pack("<HHqI4s5I", VERSION, HEADER_BYTES, t_ns, number, fourcc.encode(), width, height,
                               len(data) // height, len(data), zlib.crc32(data))  # fmt: skip
    return head + struct.pack("<I", zlib.crc32(head)) + data


def read(file):
    """Yields header and pixels (as `encode` takes them) of each complete frame of a byte stream."""
    held = b""
    while True:
        if len(held) < HEADER_BYTES:
            held += file.read(HEADER_BYTES - len(held))
            if len(held) < HEADER_BYTES:
                return
        if (header := decode(held)) is None:
            at = held.find(MAGIC, 1)  # no valid header here: continue at the next magic number
            held = held[at:] if at > 0 else held[-(len(MAGIC) - 1) :]
            continue
        held += file.read(HEADER_BYTES + header.size - len(held))
        data = held[HEADER_BYTES : HEADER_BYTES + header.size]
        if len(data) < header.size or zlib.crc32(data) != header.crc:
            held = held[1:]  # the next frame may begin within the corrupted one
            continue
        yield header, pixel_formats.array(header.format, header.width, header.height, data)
        held = held[HEADER_BYTES + header.size :]
