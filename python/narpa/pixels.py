"""Pixel formats of frames on a link, by V4L2's codes: bytes of a row, and arrays of the pixels."""
import numpy as np

# Channels and type of an element. Values of Y10, Y12 and Y14 and their mosaics are right-justified, of Y16 left-justified.
FORMATS = {"GREY": (1, np.uint8), "Y16 ": (1, "<u2"), "YUYV": (2, np.uint8), "RGB3": (3, np.uint8),
           "RGGB": (1, np.uint8), "GRBG": (1, np.uint8), "GBRG": (1, np.uint8), "BA81": (1, np.uint8),
           "RG16": (1, "<u2"), "GR16": (1, "<u2"), "GB16": (1, "<u2"), "BYR2": (1, "<u2"),
           **{code: (1, "<u2") for code in "Y10 ,Y12 ,Y14 ,RG10,RG12,RG14,BA10,BA12,GR14,GB10,GB12,GB14,BG10,BG12,BG14".split(",")}}  # fmt: skip
# Bits of a pixel; packed as MIPI CSI-2 RAW10 and RAW12.
PACKED = {"Y10P": 10, "Y12P": 12, "pRAA": 10, "pgAA": 10, "pGAA": 10, "pBAA": 10, "pRCC": 12, "pgCC": 12, "pGCC": 12, "pBCC": 12}  # fmt: skip
# The same, lowest bits first; GenICam's names, for V4L2 has no codes of them.
GENICAM = {f"{kind}{bits}p": bits for kind in ("Mono", "BayerRG", "BayerGR", "BayerGB", "BayerBG") for bits in (10, 12)}
BIG_ENDIAN_MARK = 0x80  # in the last character of V4L2's code


def _element(code):
    """Channels and type of an element of a format that is not packed; None: unknown."""
    if code in FORMATS:
        return FORMATS[code]
    channels, kind = FORMATS.get(code[:-1] + chr(ord(code[-1]) & ~BIG_ENDIAN_MARK), (0, np.uint8)) if code else (0, np.uint8)
    return (channels, np.dtype(kind).newbyteorder(">")) if kind == "<u2" else None


def name(code):
    """V4L2's code for people: "Y12 " is "Y12", and "Y12-BE" where it is big-endian."""
    mark = ord(code[-1]) & BIG_ENDIAN_MARK
    return (code[:-1] + chr(ord(code[-1]) ^ mark)).rstrip() + ("-BE" if mark else "")


def row_bytes(code, width):
    """Bytes of a row's pixels; 0 for an unknown format."""
    bits = PACKED.get(code) or GENICAM.get(code)
    if bits:
        return width * bits // 8
    channels, kind = _element(code) or (0, np.uint8)
    return width * channels * np.dtype(kind).itemsize


def unpack(data, bits):
    """Values of pixels packed as MIPI does, right-justified."""
    pixels = 4 if bits == 10 else 2
    groups = np.frombuffer(data, np.uint8).reshape(-1, pixels + 1).astype(np.uint16)
    low_bits = 8 // pixels
    low = groups[:, pixels:] >> (low_bits * np.arange(pixels, dtype=np.uint16)) & ((1 << low_bits) - 1)
    return (groups[:, :pixels] << low_bits | low).reshape(-1)


def unpack_genicam(data, bits):
    """Values of pixels packed as GenICam's Mono10p and Mono12p, right-justified."""
    pixel_bits = np.unpackbits(np.frombuffer(data, np.uint8), bitorder="little").reshape(-1, bits)
    return pixel_bits.astype(np.uint16) @ (1 << np.arange(bits, dtype=np.uint16))


def array(code, width, height, data):
    """Pixels of a frame: height x width, or height x width x channels. Rows may have padding."""
    rows = np.frombuffer(data, np.uint8).reshape(height, -1)[:, : row_bytes(code, width)]
    for packed, values in ((PACKED, unpack), (GENICAM, unpack_genicam)):
        if code in packed:
            return values(rows.tobytes(), packed[code]).reshape(height, width)
    channels, kind = _element(code)
    return np.frombuffer(rows.tobytes(), kind).reshape((height, width) + ((channels,) if channels > 1 else ()))


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
