"""Pixel formats of frames on a link, by V4L2's codes: bytes of a row, and arrays of the pixels."""
import numpy as np

# Channels and type of an element. Values of Y10, Y12 and Y14 and their mosaics are right-justified, of Y16 left-justified.
FORMATS = {"GREY": (1, np.uint8), "Y16 ": (1, "<u2"), "YUYV": (2, np.uint8), "RGB3": (3, np.uint8),
           "RGGB": (1, np.uint8), "GRBG": (1, np.uint8), "GBRG": (1, np.uint8), "BA81": (1, np.uint8),
           "RG16": (1, "<u2"), "GR16": (1, "<u2"), "GB16": (1, "<u2"), "BYR2": (1, "<u2"),
           **{code: (1, "<u2") for code in "Y10 ,Y12 ,Y14 ,RG10,RG12,RG14,BA10,BA12,GR14,GB10,GB12,GB14,BG10,BG12,BG14".split(",")}}  # fmt: skip
# Bits of a pixel; packed as MIPI CSI-2 RAW10 and RAW12.
PACKED = {"Y10P": 10, "Y12P": 12, "pRAA": 10, "pgAA": 10, "pGAA": 10, "pBAA": 10, "pRCC": 12, "pgCC": 12, "pGCC": 12, "pBCC": 12}  # fmt: skip


def row_bytes(code, width):
    """Bytes of a row; 0 for an unknown format."""
    if code in PACKED:
        return width * PACKED[code] // 8
    channels, kind = FORMATS.get(code, (0, np.uint8))
    return width * channels * np.dtype(kind).itemsize


def unpack(data, bits):
    """Values of packed pixels, right-justified."""
    pixels = 4 if bits == 10 else 2
    groups = np.frombuffer(data, np.uint8).reshape(-1, pixels + 1).astype(np.uint16)
    low_bits = 8 // pixels
    low = groups[:, pixels:] >> (low_bits * np.arange(pixels, dtype=np.uint16)) & ((1 << low_bits) - 1)
    return (groups[:, :pixels] << low_bits | low).reshape(-1)


def array(code, width, height, data):
    """Pixels of a frame: height x width, or height x width x channels."""
    if code in PACKED:
        return unpack(data, PACKED[code]).reshape(height, width)
    channels, kind = FORMATS[code]
    return np.frombuffer(data, kind).reshape((height, width) + ((channels,) if channels > 1 else ()))


def test_pattern(pattern, frame, samples, bits):
    """Samples of a camera's `test_pattern`, "counter" or "prbs": right-justified values of `bits` (protocols/video/README.md)."""
    if pattern == "counter":
        return (np.arange(samples) + frame) % (1 << bits)
    if pattern != "prbs":
        raise ValueError(f'no test pattern {pattern!r}, expected "counter" or "prbs"')
    register = (1 << 23) - 1 - frame % (1 << 22)
    sequence = np.zeros(23 + samples * bits, np.uint8)
    sequence[:23] = [register >> (22 - i) & 1 for i in range(23)]
    for start in range(23, sequence.size, 18):  # the next 18 bits depend on earlier ones alone
        n = min(18, sequence.size - start)
        sequence[start : start + n] = sequence[start - 23 : start - 23 + n] ^ sequence[start - 18 : start - 18 + n]
    values = sequence[23:].reshape(samples, bits).astype(np.uint32)
    return values @ (1 << np.arange(bits - 1, -1, -1, dtype=np.uint32))
