"""Data packets of the Velodyne VLP-16 (User Manual 63-9243 Rev. D, chapter 9), as narpa sends and records them.

Frame: x right, y forward, z up; azimuth clockwise from +y seen from above. A packet has 24 sequences of 16 lasers.
"""
import socket
import struct

import numpy as np

from narpa import pcap

PORT, PACKET_BYTES = 2368, 1206
BUFFER_BYTES, SO_RCVBUFFORCE = 4 << 20, 33  # asm-generic/socket.h; the socket module has no name for it
BLOCKS, LASERS = 12, 16
LASER_PERIOD_S, SEQUENCE_PERIOD_S = 2.304e-6, 55.296e-6
RANGE_STEP_M, AZIMUTH_STEP_DEG = 0.002, 0.01
TURN_DEG, TURN_MOST_DEG = (360 * rate_hz * 2 * SEQUENCE_PERIOD_S for rate_hz in (10, 25))  # of the rotor during a block
STRONGEST_RETURN, LAST_RETURN, VLP_16 = 0x37, 0x38, 0x22
NO_REFLECTIVITY = 255  # value in the packet where there is no return
ELEVATION_DEG = np.array([-15, 1, -13, 3, -11, 5, -9, 7, -7, 9, -5, 11, -3, 13, -1, 15], float)
# Height of each laser above the sensor's origin ("vertical correction", table 9-1).
HEIGHT_M = 1e-3 * np.array([11.2, -0.7, 9.7, -2.2, 8.1, -3.7, 6.6, -5.1, 5.1, -6.6, 3.7, -8.1, 2.2, -9.7, 0.7, -11.2])

POINT = np.dtype([("position_m", float, 3), ("range_m", float), ("azimuth_rad", float), ("reflectivity", np.uint8),
                  ("laser", np.uint8), ("t_s", float)])  # fmt: skip
BLOCK = np.dtype([("flag", "<u2"), ("azimuth_cdeg", "<u2"), ("returns", [("range", "<u2"), ("reflectivity", "u1")], 32)])
FLAG = 0xEEFF  # bytes FF EE


def decode(packet):
    """The returns of a packet as an array of POINT, in firing order. t_s: seconds after the full UTC hour."""
    if len(packet) != PACKET_BYTES:
        raise ValueError(f"a packet of {len(packet)} bytes, expected {PACKET_BYTES}")
    blocks = np.frombuffer(packet, BLOCK, BLOCKS)
    if (blocks["flag"] != FLAG).any():
        raise ValueError("a block of the packet does not begin with FF EE")
    stamp_us, mode, product = struct.unpack_from("<IBB", packet, BLOCKS * BLOCK.itemsize)
    if product != VLP_16:
        raise ValueError(f"a packet of product 0x{product:02X}, expected 0x{VLP_16:02X}, the VLP-16")
    if mode not in (STRONGEST_RETURN, LAST_RETURN):
        raise ValueError(f"a packet of return mode 0x{mode:02X}, expected one return a shot: 0x37 (strongest) or 0x38 (last)")
    starts = blocks["azimuth_cdeg"] * AZIMUTH_STEP_DEG
    turns = np.diff(starts) % 360  # between blocks; the last block repeats the value before it
    turns = np.append(turns, turns[-1])
    steady = np.sort(turns[turns <= TURN_MOST_DEG])
    usual = steady[len(steady) // 2] if len(steady) else TURN_DEG
    # Azimuths jump where a limited field of view ends, and may step back.
    turns = np.where((turns > TURN_MOST_DEG) | (abs(turns - usual) > usual / 2 + 2 * AZIMUTH_STEP_DEG), usual, turns)
    sequence, laser = np.divmod(np.arange(32), LASERS)
    offset_s = sequence * SEQUENCE_PERIOD_S + laser * LASER_PERIOD_S
    azimuth_deg = starts[:, None] + turns[:, None] * offset_s / (2 * SEQUENCE_PERIOD_S)
    points = np.zeros((BLOCKS, 32), POINT)
    points["azimuth_rad"] = np.radians(azimuth_deg % 360)
    points["range_m"] = blocks["returns"]["range"] * RANGE_STEP_M
    points["reflectivity"] = blocks["returns"]["reflectivity"]
    points["laser"] = laser
    points["t_s"] = 1e-6 * stamp_us + np.arange(BLOCKS)[:, None] * 2 * SEQUENCE_PERIOD_S + offset_s
    elevation, azimuth = np.radians(ELEVATION_DEG[laser]), points["azimuth_rad"]
    points["position_m"] = points["range_m"][..., None] * np.stack(
        [np.cos(elevation) * np.sin(azimuth), np.cos(elevation) * np.cos(azimuth), np.sin(elevation) + 0 * azimuth], -1)  # fmt: skip
    points["position_m"][..., 2] += HEIGHT_M[laser]
    points = points.reshape(-1)
    return points[points["range_m"] > 0]


def encode(azimuths_deg, ranges_m, reflectivities=0, t_s=0.0):
    """Encodes a packet from the azimuths of the first shots of its 12 blocks and the ranges of its 24 x 16 shots (0: no return)."""
    blocks = np.zeros(BLOCKS, BLOCK)
    blocks["flag"] = FLAG
    blocks["azimuth_cdeg"] = np.round(np.asarray(azimuths_deg) / AZIMUTH_STEP_DEG).astype(int) % 36000
    steps = np.round(np.asarray(ranges_m, float).reshape(BLOCKS, 32) / RANGE_STEP_M)
    blocks["returns"]["range"] = np.where((steps > 0) & (steps < 65536), steps, 0)
    blocks["returns"]["reflectivity"] = np.where(blocks["returns"]["range"] > 0, np.broadcast_to(reflectivities, (24, 16)).reshape(BLOCKS, 32), NO_REFLECTIVITY)
    return blocks.tobytes() + struct.pack("<IBB", int(t_s * 1e6) % 3_600_000_000, STRONGEST_RETURN, VLP_16)


def receive(port=PORT, host="", timeout_s=None):
    """Yields packets as they arrive over UDP, until none arrives for timeout_s."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as listener:
        # The default buffer holds 92 packets, 0.12 s. Only root may exceed net.core.rmem_max.
        try:
            listener.setsockopt(socket.SOL_SOCKET, SO_RCVBUFFORCE, BUFFER_BYTES)
        except PermissionError:
            listener.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, BUFFER_BYTES)
        listener.bind((host, port))
        listener.settimeout(timeout_s)
        while True:
            try:
                packet = listener.recv(2048)
            except socket.timeout:
                return
            if len(packet) == PACKET_BYTES:
                yield packet


def read_pcap(path, unit=None):
    """The data packets of a capture, as `--lidar LIDAR=FILE.pcap` and tcpdump write it. `unit`: pcap.packets()."""
    return pcap.packets(path, lambda payload: len(payload) == PACKET_BYTES, unit)
