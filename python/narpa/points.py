"""Packets of LiDARs that are described by a file (protocols/lidar/README.md, "Point packets"), as narpa sends and records them.

Frame: x right, y forward, z up; azimuth clockwise from +y seen from above.
"""
import struct
import zlib
from collections import namedtuple

import numpy as np

from narpa import pcap

PORT, MAGIC = 2370, b"NLPP"
HEADER = struct.Struct("<4sBBHIIqIIII")
RECORD = np.dtype([("t_offset_ns", "<u4"), ("azimuth", "<i4"), ("elevation", "<i4"), ("range", "<u4"), ("velocity", "<i4"),
                   ("reflectivity", "<u2"), ("beam", "<u2")])  # fmt: skip
NO_VELOCITY = -(2**31)
ANGLE_STEP_RAD, REFLECTIVITY_STEP = 1e-8, 1e-3

Packet = namedtuple("Packet", "frame first_shot shots_per_frame frame_unix_ns dual points")
POINT = np.dtype([("position_m", float, 3), ("range_m", float), ("azimuth_rad", float), ("elevation_rad", float),
                  ("velocity_m_s", float), ("reflectivity", float), ("beam", int), ("shot", int), ("echo", int),
                  ("t_unix_ns", np.int64)])  # fmt: skip


def decode(packet):
    """Decodes a Packet. `points` are its returns as an array of POINT; `shot` is the index of the shot in its frame."""
    if len(packet) < HEADER.size:
        raise ValueError(f"a packet of {len(packet)} bytes, expected {HEADER.size} or more")
    (magic, version, flags, count, frame, first, start_ns, shots, range_step_um, velocity_step_um_s,
     checksum) = HEADER.unpack_from(packet)  # fmt: skip
    if magic != MAGIC or version != 1 or flags > 1:
        raise ValueError("not a point packet of version 1")
    if len(packet) != HEADER.size + count * RECORD.itemsize:
        raise ValueError(f"a packet of {len(packet)} bytes, expected {HEADER.size + count * RECORD.itemsize}")
    if checksum != zlib.crc32(packet[HEADER.size :], zlib.crc32(packet[: HEADER.size - 4])):
        raise ValueError("the packet's checksum is wrong")
    records = np.frombuffer(packet, RECORD, count, HEADER.size)
    each = 1 + (flags & 1)
    points = np.zeros(count, POINT)
    azimuth, elevation = records["azimuth"] * ANGLE_STEP_RAD, records["elevation"] * ANGLE_STEP_RAD
    points["azimuth_rad"], points["elevation_rad"] = azimuth, elevation
    points["range_m"] = records["range"] * (1e-6 * range_step_um)
    direction = [np.cos(elevation) * np.sin(azimuth), np.cos(elevation) * np.cos(azimuth), np.sin(elevation)]
    points["position_m"] = points["range_m"][:, None] * np.stack(direction, -1)
    known = records["velocity"] != NO_VELOCITY
    points["velocity_m_s"] = np.where(known, records["velocity"] * (1e-6 * velocity_step_um_s), np.nan)
    points["reflectivity"] = records["reflectivity"] * REFLECTIVITY_STEP
    points["beam"] = records["beam"]
    points["shot"], points["echo"] = first + np.arange(count) // each, np.arange(count) % each
    points["t_unix_ns"] = start_ns + records["t_offset_ns"].astype(np.int64)
    return Packet(frame, first, shots, start_ns, flags & 1 == 1, points[records["range"] > 0])


def read_pcap(path, unit=None):
    """Yields the decoded packets of a capture. `unit`: pcap.packets()."""
    return map(decode, pcap.packets(path, lambda payload: payload[:4] == MAGIC, unit))
