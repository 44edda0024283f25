"""Lidar packets of Ouster sensors (Firmware User Manual, "Lidar Data Packet Format"), as narpa sends and records them.

A sensor's metadata JSON states its beams and the format of its packets. A packet has 16 columns, unless the metadata state another number; all shots of a column have
the same time. Positions are in Ouster's sensor frame: x forward, y left, z up. (narpa's LiDAR frame: x right, y forward, z up.)
"""
import json
import struct
import warnings
from collections import Counter
from pathlib import Path

import numpy as np

from narpa import pcap

PORT, COLUMNS = 7502, 16
# For each profile: sizes in bytes of packet header, column header, pixel, column footer, packet footer; fields of a pixel as
# (first bit, bits, binary exponent of the unit). Ranges are in mm. The fields of the second return end in 2.
PROFILES = {
    "LEGACY": ((0, 16, 12, 4, 0), {"range": (0, 20, 0), "flags": (28, 4, 0), "reflectivity": (32, 8, 0), "signal": (48, 16, 0), "near_ir": (64, 16, 0)}),
    "RNG19_RFL8_SIG16_NIR16": (
        (32, 12, 12, 0, 32),
        {"range": (0, 19, 0), "flags": (19, 5, 0), "reflectivity": (32, 8, 0), "signal": (48, 16, 0), "near_ir": (64, 16, 0)}),
    "RNG19_RFL8_SIG16_NIR16_DUAL": (
        (32, 12, 16, 0, 32),
        {"range": (0, 19, 0), "flags": (19, 5, 0), "reflectivity": (24, 8, 0), "range2": (32, 19, 0), "flags2": (51, 5, 0),
         "reflectivity2": (56, 8, 0), "signal": (64, 16, 0), "signal2": (80, 16, 0), "near_ir": (96, 16, 0)}),
    "RNG15_RFL8_NIR8": ((32, 12, 4, 0, 32), {"range": (0, 15, 3), "flags": (15, 1, 0), "reflectivity": (16, 8, 0), "near_ir": (24, 8, 4)}),
}  # fmt: skip
LIDAR_PACKET = 1
LIDAR_TO_SENSOR = (-1, 0, 0, 0, 0, -1, 0, 0, 0, 0, 1, 36.18, 0, 0, 0, 1)  # where the metadata do not state it

POINT = np.dtype([("position_m", float, 3), ("range_m", float), ("reflectivity", np.uint8), ("signal", np.uint16),
                  ("near_ir", np.uint16), ("beam", np.uint8), ("echo", np.uint8), ("column", np.uint16), ("t_ns", np.uint64)])  # fmt: skip


def packet_bytes(profile, beams, per_packet=COLUMNS):
    (header, column_header, pixel, column_footer, footer), _ = PROFILES[profile]
    return header + per_packet * (column_header + beams * pixel + column_footer) + footer


class Packet:
    """The decoded fields of a packet: `frame_id`, `init_id` and `serial` (0 in LEGACY); `t_ns`, `column` and `valid` of each column;
    `fields`, arrays of columns x beams."""

    def __init__(self, data, profile, beams, per_packet=COLUMNS):
        (header, column_header, pixel, column_footer, footer), fields = PROFILES[profile]
        column_bytes = column_header + beams * pixel + column_footer
        expected = packet_bytes(profile, beams, per_packet)
        if len(data) != expected:
            raise ValueError(f"a packet of {len(data)} bytes, expected {expected} of profile {profile} with {beams} beams")
        self.frame_id = self.init_id = self.serial = 0
        self.header, self.footer = data[:header], data[len(data) - footer :]
        if header:
            kind, self.frame_id = struct.unpack_from("<HH", data)
            if kind != LIDAR_PACKET:
                raise ValueError(f"a packet of type {kind}, expected {LIDAR_PACKET}, the lidar's")
            self.init_id, self.serial = int.from_bytes(data[4:7], "little"), int.from_bytes(data[7:12], "little")
        columns = np.frombuffer(data, np.uint8, per_packet * column_bytes, header).reshape(per_packet, column_bytes)
        part = lambda first, kind: np.ascontiguousarray(columns[:, first : first + np.dtype(kind).itemsize]).view(kind)[:, 0]  # noqa: E731
        self.t_ns, self.column = part(0, "<u8"), part(8, "<u2")
        if profile == "LEGACY":
            self.frame_id, self.encoder = int(part(10, "<u2")[0]), part(12, "<u4")
            self.valid = part(column_bytes - 4, "<u4") == 0xFFFFFFFF
        else:
            self.valid = part(10, "<u2") & 1 == 1
        pixels = columns[:, column_header : column_header + beams * pixel].reshape(per_packet, beams, pixel).astype(np.uint64)
        self.fields = {}
        for name, (first, bits, power) in fields.items():
            first_byte, last_byte = first // 8, (first + bits - 1) // 8
            value = sum(pixels[:, :, i] << np.uint64(8 * (i - first_byte)) for i in range(first_byte, last_byte + 1))
            value = value >> np.uint64(first % 8) & np.uint64((1 << bits) - 1)
            self.fields[name] = (value << np.uint64(power)).astype(np.int64)


class Sensor:
    """A sensor, described by its metadata: a dictionary, or the path of a JSON file."""

    def __init__(self, metadata):
        document = metadata if isinstance(metadata, dict) else json.loads(Path(metadata).read_text())
        flat = dict(document)
        for section in document.values():  # since firmware 2.4 the keys are in sections
            if isinstance(section, dict):
                flat.update(section)
        self.altitude, self.azimuth = (np.radians(flat[f"beam_{a}_angles"]) for a in ("altitude", "azimuth"))
        columns, self.rate_hz = (int(n) for n in flat["lidar_mode"].split("x"))
        self.columns, self.profile = flat.get("columns_per_frame", columns), flat.get("udp_profile_lidar", "LEGACY")
        self.per_packet = int(flat.get("columns_per_packet", COLUMNS))
        self.n_m = 1e-3 * flat["lidar_origin_to_beam_origin_mm"]
        out_mm, up_mm = (flat["beam_to_lidar_transform"][i] for i in (3, 11)) if "beam_to_lidar_transform" in flat else (1e3 * self.n_m, 0)
        self.out_m, self.up_m = 1e-3 * out_mm, 1e-3 * up_mm
        self.lidar_to_sensor = np.array(flat.get("lidar_to_sensor_transform", LIDAR_TO_SENSOR), float).reshape(4, 4)
        self.init_id, self.serial = flat.get("initialization_id", 0), int(flat.get("prod_sn") or 0)

    def packet(self, data):
        """Decodes the fields of a packet."""
        return Packet(data, self.profile, len(self.altitude), self.per_packet)

    def positions(self, columns, range_mm):
        """Positions in the sensor frame, metres. `range_mm` is an array of columns x beams, as in a packet."""
        encoder = 2 * np.pi * (1 - columns[:, None] / self.columns)
        azimuth, out = encoder - self.azimuth, 1e-3 * range_mm - self.n_m
        lidar = np.stack([out * np.cos(azimuth) * np.cos(self.altitude) + self.out_m * np.cos(encoder),
                          out * np.sin(azimuth) * np.cos(self.altitude) + self.out_m * np.sin(encoder),
                          out * np.sin(self.altitude) + self.up_m], -1)  # fmt: skip
        return lidar @ self.lidar_to_sensor[:3, :3].T + 1e-3 * self.lidar_to_sensor[:3, 3]

    def decode(self, data):
        """The returns of a packet as an array of POINT, in firing order; the strongest return of a shot comes first."""
        packet = self.packet(data)
        echoes = 2 if "range2" in packet.fields else 1
        points = np.zeros((self.per_packet, len(self.altitude), echoes), POINT)
        none = np.zeros((self.per_packet, len(self.altitude)), int)
        for echo, suffix in enumerate(("", "2")[:echoes]):
            range_mm = packet.fields["range" + suffix] * packet.valid[:, None]
            points["position_m"][:, :, echo] = self.positions(packet.column, range_mm)
            points["range_m"][:, :, echo] = 1e-3 * range_mm
            for name in ("reflectivity", "signal"):
                points[name][:, :, echo] = packet.fields.get(name + suffix, none)
            points["echo"][:, :, echo] = echo
        points["near_ir"] = packet.fields["near_ir"][:, :, None]
        points["beam"] = np.arange(len(self.altitude))[:, None]
        points["column"], points["t_ns"] = packet.column[:, None, None], packet.t_ns[:, None, None]
        points = points.reshape(-1)
        return points[points["range_m"] > 0]

    def read_pcap(self, path, unit=None):
        """The lidar packets of a capture. Those with other identities than the metadata state: an error if there are no
        others, else a warning. `unit`: pcap.packets()."""
        size, strange = packet_bytes(self.profile, len(self.altitude), self.per_packet), Counter()

        def is_ours(payload):
            why = self._mismatch(payload) if len(payload) == size else None
            strange[why] += why is not None
            return len(payload) == size and why is None

        packets = list(pcap.packets(path, is_ours, unit))
        text = f"{path}: packets of another sensor: " + ", ".join(f"{n}: {why}" for why, n in strange.items() if why)
        if strange.total() and not packets:
            raise ValueError(text)
        if strange.total():
            warnings.warn(text, stacklevel=2)
        return iter(packets)

    def _mismatch(self, data):
        if self.profile == "LEGACY":
            return None
        for name, found, stated in (("init id", data[4:7], self.init_id), ("serial number", data[7:12], self.serial)):
            found = int.from_bytes(found, "little")
            if stated and found != stated:
                return f"{name} {found} in the packets, {stated} in the metadata"
        return None
