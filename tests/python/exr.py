"""Reads what narpa writes as OpenEXR: scan lines of 32-bit floats, compressed with ZIP (the OpenEXR file layout, openexr.com)."""
import struct
import zlib

import numpy as np

ROWS_OF_ZIP = 16


def unzipped(data, size):
    """Undoes the deflation, the differences of neighbouring bytes, and the split into even and odd bytes."""
    if len(data) == size:  # did not become smaller, stored as it is
        return data
    raw = np.frombuffer(zlib.decompress(data), np.uint8).astype(np.int64)
    raw[1:] -= 128
    raw = (np.cumsum(raw) % 256).astype(np.uint8)
    out = np.empty(len(raw), np.uint8)
    half = (len(raw) + 1) // 2
    out[0::2], out[1::2] = raw[:half], raw[half:]
    return out.tobytes()


def read(path):
    """{channel: (h, w) float32}"""
    file = path.read_bytes()
    assert struct.unpack_from("<I", file)[0] == 20000630, "no OpenEXR file"
    at, header = 8, {}
    while file[at]:
        name_end = file.index(b"\0", at)
        type_end = file.index(b"\0", name_end + 1)
        (size,) = struct.unpack_from("<i", file, type_end + 1)
        header[file[at:name_end].decode()] = file[type_end + 5:type_end + 5 + size]
        at = type_end + 5 + size
    at += 1
    x0, y0, x1, y1 = struct.unpack("<4i", header["dataWindow"])
    width, height = x1 - x0 + 1, y1 - y0 + 1
    channels, rest = [], header["channels"]
    while rest[0]:
        name, rest = rest.split(b"\0", 1)
        assert struct.unpack_from("<i", rest)[0] == 2, "not 32-bit floats"
        channels.append(name.decode())
        rest = rest[16:]
    assert header["compression"] in (b"\x03", b"\x00"), header["compression"]
    rows = ROWS_OF_ZIP if header["compression"] == b"\x03" else 1
    blocks = -(-height // rows)
    image = np.empty((height, len(channels), width), np.float32)
    for offset in struct.unpack_from(f"<{blocks}Q", file, at):
        y, size = struct.unpack_from("<ii", file, offset)
        n = min(rows, height - (y - y0))
        data = unzipped(file[offset + 8:offset + 8 + size], n * len(channels) * width * 4)
        image[y - y0:y - y0 + n] = np.frombuffer(data, "<f4").reshape(n, len(channels), width)
    return {name: image[:, k] for k, name in enumerate(channels)}
