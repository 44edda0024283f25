"""Frames as `narpa run --video CAMERA=udp:HOST:PORT` sends them: receives the datagrams and puts them together.

The format is defined in protocols/video/README.md. Run as a program, it prints a line for each frame:

    python3 -m narpa.datagrams 5004
"""
import socket
import struct
import sys
import time
import zlib
from typing import NamedTuple

import numpy as np

from . import pixels as pixel_formats

MAGIC, VERSION, HEADER_BYTES = b"NRPD", 1, 52
RECEIVE_BUFFER = 8 << 20  # of the socket; the kernel grants no more than net.core.rmem_max


class Header(NamedTuple):
    t_ns: int  # mid-exposure, simulation clock
    frame: int
    format: str  # V4L2 fourcc
    width: int
    height: int
    row_bytes: int
    index: int  # of this datagram
    count: int  # of the frame's datagrams
    row: int  # where the bytes belong
    byte_in_row: int


class Frame(NamedTuple):
    header: Header  # of its first datagram that came
    pixels: np.ndarray  # height x width, or height x width x channels; 0 where a datagram is lost
    lost: int  # datagrams


def decode(data):
    """Header and bytes of a datagram; None if it is not valid."""
    if len(data) <= HEADER_BYTES or data[:4] != MAGIC:
        return None
    version, length, t_ns, frame, fourcc, *rest, crc = struct.unpack_from("<HHqI4sHHIIIIII", data, 4)
    header = Header(t_ns, frame, fourcc.decode("latin-1"), *rest)
    end = header.row * header.row_bytes + header.byte_in_row + len(data) - HEADER_BYTES
    good = (version, length) == (VERSION, HEADER_BYTES) and crc == zlib.crc32(data[HEADER_BYTES:], zlib.crc32(data[:48]))
    fits = 0 < pixel_formats.row_bytes(header.format, header.width) <= header.row_bytes
    placed = fits and header.byte_in_row < header.row_bytes and end <= header.row_bytes * header.height
    return (header, data[HEADER_BYTES:]) if good and placed and header.index < header.count else None


class Assembly:
    """Puts datagrams together. A frame ends when it is complete, or when the second one after it begins."""

    def __init__(self):
        self.begun = {}  # frame number: header, its bytes, indices that came
        self.ended = None  # number of the newest frame that has ended
        self.refused = 0  # datagrams that are not valid, came twice or too late

    def take(self, data):
        """The frames that end with this datagram, in order."""
        decoded = decode(data)
        if decoded is None or (self.ended is not None and -64 < self._newer(decoded[0].frame, self.ended) <= 0):
            self.refused += 1
            return []
        header, part = decoded
        ended = []
        if header.frame not in self.begun:
            if self.ended is not None and self._newer(header.frame, self.ended) <= 0:
                ended += self._end(list(self.begun))  # the sender has begun again
            while len(self.begun) > 1:
                ended += self._end([next(iter(self.begun))])
            self.begun[header.frame] = (header, bytearray(header.row_bytes * header.height), set())
        first, frame, came = self.begun[header.frame]
        if header.index in came or header.count != first.count or header[2:6] != first[2:6]:
            self.refused += 1
            return ended
        came.add(header.index)
        at = header.row * header.row_bytes + header.byte_in_row
        frame[at : at + len(part)] = part
        if len(came) == header.count:
            ended += self._end([n for n in self.begun if self._newer(n, header.frame) <= 0])
        return ended

    @staticmethod
    def _newer(number, than):
        """By how many frames; numbers wrap at 32 bits."""
        return (number - than + (1 << 31)) % (1 << 32) - (1 << 31)

    def _end(self, numbers):
        frames = []
        for number in numbers:
            header, data, came = self.begun.pop(number)
            pixels = pixel_formats.array(header.format, header.width, header.height, bytes(data))
            frames.append(Frame(header, pixels, header.count - len(came)))
            self.ended = number
        return frames


def receive(port, address="0.0.0.0", timeout_s=None):
    """Yields the frames that come to a UDP port of this machine; ends after `timeout_s` without a datagram."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as s:
        s.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER)
        s.bind((address, port))
        s.settimeout(timeout_s)
        assembly = Assembly()
        while True:
            try:
                datagram = s.recv(65536)
            except socket.timeout:
                return
            yield from assembly.take(datagram)


def main():
    if len(sys.argv) != 2 or not sys.argv[1].isdigit():
        sys.exit("usage: python3 -m narpa.datagrams PORT")
    before = None
    for frame in receive(int(sys.argv[1])):
        h, now = frame.header, time.monotonic()
        rate = "" if before is None else f", {1e3 * (now - before):.1f} ms after the one before"
        print(f"frame {h.frame}: {h.width} x {h.height} {pixel_formats.name(h.format)}, t = {h.t_ns * 1e-9:.6f} s, "
              f"{frame.lost} of {h.count} datagrams lost, mean {frame.pixels.mean():.2f}{rate}", flush=True)  # fmt: skip
        before = now


if __name__ == "__main__":
    main()
