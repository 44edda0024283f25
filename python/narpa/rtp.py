"""Frames as `narpa run --video CAMERA=rtp:HOST:PORT,sdp=FILE` sends them: uncompressed video by RFC 4175 over RTP.

Reads the SDP file, receives the packets and puts the frames together, in all bit depths that narpa sends. Written from
the standards, as protocols/video/README.md sums them up. Run as a program, it prints a line for each frame:

    python3 -m narpa.rtp camera.sdp
"""
import re
import socket
import struct
import sys
from typing import NamedTuple, Optional

import numpy as np

RECEIVE_BUFFER = 8 << 20  # of the socket; the kernel grants no more than net.core.rmem_max
FRAME_ELEMENT = 1  # of the header extension: the frame's time and number
FRAME_URI = "urn:x-narpa:frame"


class Session(NamedTuple):
    address: str
    port: int
    payload_type: int
    sampling: str  # "YCbCr-4:2:2" or "RGB"
    width: int
    height: int
    depth: int  # bits of a component

    @property
    def group(self):
        """Pixels and bytes of a group."""
        return (2, 4 * self.depth // 8) if self.sampling == "YCbCr-4:2:2" else (1, 3)


class Packet(NamedTuple):
    sequence: int  # 32 bits
    is_last: bool  # of its frame
    timestamp: int  # 90 kHz
    frame: Optional[int]  # its number, and
    t_ns: Optional[int]  # mid-exposure, simulation clock; None: not sent
    parts: list  # row, first pixel, bytes


class Frame(NamedTuple):
    number: Optional[int]
    t_ns: Optional[int]
    timestamp: int
    planes: np.ndarray  # height x width of luma, right-justified; or height x width x 3 of RGB; 0 where packets are lost
    chroma: Optional[np.ndarray]  # height x width / 2 x 2: Cb, Cr
    came: np.ndarray  # height x width: whether the pixel came


def read_sdp(text):
    """The session that an SDP file describes. ValueError: it is not one of uncompressed video."""
    found = {
        "address": re.search(r"^c=IN IP[46] ([^/\s]+)", text, re.M),
        "media": re.search(r"^m=video (\d+) RTP/AVP (\d+)", text, re.M),
        "format": re.search(r"^a=fmtp:\d+ (.*?)\r?$", text, re.M),
    }
    if None in found.values() or not re.search(r"^a=rtpmap:\d+ raw/90000", text, re.M):
        raise ValueError("not an SDP file of uncompressed video")
    values = dict(re.findall(r"([\w-]+)=([^;\s]+)", found["format"][1]))
    session = Session(found["address"][1], int(found["media"][1]), int(found["media"][2]), values["sampling"],
                      int(values["width"]), int(values["height"]), int(values["depth"]))  # fmt: skip
    if (session.sampling, session.depth) not in {("YCbCr-4:2:2", d) for d in (8, 10, 12, 16)} | {("RGB", 8)}:
        raise ValueError(f"{session.sampling} of {session.depth} bits is not read here")
    return session


def _frame_element(extension):
    """Number and time of the frame (RFC 8285, elements with one-byte headers)."""
    at = 0
    while at < len(extension):
        element, size = extension[at] >> 4, (extension[at] & 15) + 1
        if element == 15:
            break
        if element == 0:
            at += 1
            continue
        if element == FRAME_ELEMENT and size == 12 and at + 13 <= len(extension):
            t_ns, number = struct.unpack_from(">qI", extension, at + 1)
            return number, t_ns
        at += 1 + size
    return None, None


def decode(data, session):
    """The Packet of a datagram; None if it is none of the session."""
    if len(data) < 12 or data[0] >> 6 != 2 or data[1] & 127 != session.payload_type:
        return None
    low, timestamp = struct.unpack_from(">HI", data, 2)
    at, end, number, t_ns = 12 + 4 * (data[0] & 15), len(data), None, None
    if data[0] & 0x10:
        if at + 4 > end:
            return None
        profile, words = struct.unpack_from(">HH", data, at)
        if profile == 0xBEDE:
            number, t_ns = _frame_element(data[at + 4 : at + 4 + 4 * words])
        at += 4 + 4 * words
    if data[0] & 0x20:
        end -= data[-1]
    heads, more = [], True
    if at + 2 > end:
        return None
    (high,) = struct.unpack_from(">H", data, at)
    at += 2
    pixels, size = session.group
    while more:
        if at + 6 > end:
            return None
        length, row, offset = struct.unpack_from(">HHH", data, at)
        more, offset = offset >> 15, offset & 0x7FFF
        if row >= session.height or length % size or offset % pixels or offset + length // size * pixels > session.width:
            return None
        heads.append((row, offset, length))
        at += 6
    parts = []
    for row, offset, length in heads:
        if at + length > end:
            return None
        parts.append((row, offset, data[at : at + length]))
        at += length
    return Packet(high << 16 | low, bool(data[1] & 128), timestamp, number, t_ns, parts)


def _components(groups, depth):
    """Components of whole groups of 4:2:2, four a row: Cb, Y0, Cr, Y1."""
    if depth in (8, 16):
        return np.frombuffer(groups, ">u2" if depth == 16 else np.uint8).reshape(-1, 4).astype(np.uint16)
    b = np.frombuffer(groups, np.uint8).reshape(-1, 5 if depth == 10 else 3).T.astype(np.uint16)
    if depth == 10:
        values = [b[0] << 2 | b[1] >> 6, (b[1] & 63) << 4 | b[2] >> 4, (b[2] & 15) << 6 | b[3] >> 2, (b[3] & 3) << 8 | b[4]]
    else:
        values = [b[0] << 4 | b[1] >> 4, (b[1] & 15) << 8 | b[2]]
    return np.stack(values, axis=1).reshape(-1, 4)


class Assembly:
    """Puts packets together. A frame ends with its last pixel, or when a packet of a later one comes."""

    def __init__(self, session):
        self.session = session
        self.begun = self.ended = None
        self.refused = 0  # packets that are none of the session, or came too late

    def take(self, data):
        """The frames that end with this packet."""
        packet = decode(data, self.session)
        now = self.begun.timestamp if self.begun else self.ended
        if packet is None or (now is not None and 0 < (now - packet.timestamp) % (1 << 32) < 90_000) or packet.timestamp == self.ended:
            self.refused += 1
            return []
        frames = []
        if self.begun and packet.timestamp != self.begun.timestamp:
            frames.append(self._end())
        if self.begun is None:
            self._begin(packet)
        for part in packet.parts:
            self._place(*part)
        return frames + ([self._end()] if self.left == 0 else [])

    def _begin(self, packet):
        s = self.session
        deep = np.uint8 if s.depth == 8 else np.uint16
        has_chroma = s.sampling != "RGB"
        planes = np.zeros((s.height, s.width) if has_chroma else (s.height, s.width, 3), deep)
        chroma = np.zeros((s.height, s.width // 2, 2), deep) if has_chroma else None
        self.left = s.height * s.width  # pixels
        self.begun = Frame(packet.frame, packet.t_ns, packet.timestamp, planes, chroma, np.zeros((s.height, s.width), bool))

    def _place(self, row, offset, data):
        pixels, size = self.session.group
        end = offset + len(data) // size * pixels
        if self.begun.chroma is None:
            self.begun.planes[row, offset:end] = np.frombuffer(data, np.uint8).reshape(-1, 3)
        else:
            c = _components(data, self.session.depth)
            self.begun.planes[row, offset:end] = c[:, 1::2].reshape(-1)
            self.begun.chroma[row, offset // 2 : end // 2] = c[:, ::2]
        came = self.begun.came[row, offset:end]
        self.left -= came.size - np.count_nonzero(came)
        came[:] = True

    def _end(self):
        frame, self.begun = self.begun, None
        self.ended = frame.timestamp
        return frame


def receive(session, address=None, timeout_s=None):
    """Yields the frames that come to this machine; ends after `timeout_s` without a packet. `address`: of this machine;
    None: the session's."""
    with socket.socket(socket.AF_INET6 if ":" in session.address else socket.AF_INET, socket.SOCK_DGRAM) as s:
        s.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER)
        s.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        s.bind((session.address if address is None else address, session.port))
        if s.family == socket.AF_INET and 224 <= int(session.address.split(".")[0]) < 240:
            s.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, socket.inet_aton(session.address) + socket.inet_aton("0.0.0.0"))
        s.settimeout(timeout_s)
        assembly = Assembly(session)
        while True:
            try:
                packet = s.recv(65536)
            except socket.timeout:
                return
            yield from assembly.take(packet)


def main():
    if len(sys.argv) != 2:
        sys.exit("usage: python3 -m narpa.rtp FILE.sdp")
    with open(sys.argv[1], encoding="utf-8") as file:
        session = read_sdp(file.read())
    for frame in receive(session):
        lost = 100 * (1 - frame.came.mean())
        name = f"frame {frame.number}, t = {frame.t_ns * 1e-9:.6f} s" if frame.number is not None else f"time stamp {frame.timestamp}"
        print(f"{name}: {session.width} x {session.height} {session.sampling} of {session.depth} bits, "
              f"{lost:.2f} % of the pixels lost, mean {frame.planes.mean():.2f}", flush=True)  # fmt: skip


if __name__ == "__main__":
    main()
