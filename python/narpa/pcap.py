"""Captures (pcap, pcapng, plain or by gzip), as `narpa run --lidar LIDAR=FILE.pcap`, tcpdump and Wireshark write them.

What is read, and what is dropped and counted: protocols/lidar/README.md, "What a capture may hold".
"""
import gzip
import ipaddress
import struct
import warnings
import zlib
from collections import Counter, namedtuple

ORDER = {b"\xd4\xc3\xb2\xa1": ("<", 1000), b"\x4d\x3c\xb2\xa1": ("<", 1), b"\xa1\xb2\xc3\xd4": (">", 1000), b"\xa1\xb2\x3c\x4d": (">", 1)}
# Link types: bytes of the header, where it states the EtherType (None: it does not).
LINKS = {1: (14, 12), 113: (16, 14), 276: (20, 0), 0: (4, None), 108: (4, None), 12: (0, None), 101: (0, None), 228: (0, None), 229: (0, None)}
VLAN_TYPES, IP_TYPES = (0x8100, 0x88A8, 0x9100), (0x0800, 0x86DD)
UDP, FRAGMENT, AUTHENTICATION = 17, 44, 51
EXTENSIONS = (0, 43, AUTHENTICATION, 60, 135)
FRAGMENTS_NS, REPEATED_NS = 10**9, 60 * 10**9  # as in protocols/captured_datagrams.cpp

Datagram = namedtuple("Datagram", "t_ns source port payload")  # source: an address; port: the destination's
Capture = namedtuple("Capture", "datagrams counts cut")


class _Malformed(Exception):
    pass


def read(path):
    """A Capture: its UDP datagrams by capture time, each once; `counts` of frames by what became of them (frames, other, cut,
    malformed, repeated; incomplete: datagrams); `cut`, why the file's end could not be read (None: it was read to its end)."""
    reader, cut = _Reader(), None
    with open(path, "rb") as file:
        compressed = file.read(2) == b"\x1f\x8b"
    with (gzip.open if compressed else open)(path, "rb") as file:
        try:
            for t_ns, link, data, length in _frames(path, file):
                reader.take(t_ns, link, data, length)
        except (EOFError, zlib.error, gzip.BadGzipFile, struct.error, IndexError) as error:
            cut = str(error)
    return Capture(reader.finish(), reader.counts, cut)


def udp_payloads(path):
    """The payloads of the UDP datagrams of a capture by capture time, each once. Warns of losses."""
    return (d.payload for d in _read_and_warn(path).datagrams)


def packets(path, is_packet, unit=None):
    """The payloads for which is_packet(payload) is true, of one unit. `unit`: its source address, and destination port, as
    "192.168.1.201:2368"; needed only if the capture holds the packets of several."""
    chosen, units = [], Counter()
    for d in _read_and_warn(path).datagrams:
        name = f"{d.source}:{d.port}"
        if is_packet(d.payload) and (unit is None or name == unit or name.startswith(unit + ":")):
            units[name] += 1
            chosen.append(d.payload)
    if len(units) > 1:
        raise ValueError(f"{path}: packets of {len(units)} units: {', '.join(sorted(units))}; choose one with unit=")
    return iter(chosen)


def _read_and_warn(path):
    capture = read(path)
    if capture.cut:
        warnings.warn(f"{path}: cut short, what is whole is used: {capture.cut}", stacklevel=3)
    lost = [f"{capture.counts[why]} {why}" for why in ("cut", "malformed", "incomplete", "repeated") if capture.counts[why]]
    if lost:
        warnings.warn(f"{path}: dropped: {', '.join(lost)}", stacklevel=3)
    return capture


def _exactly(file, size, what):
    data = file.read(max(size, 0))
    if len(data) != size:
        raise EOFError(f"{len(data)} of {size} bytes of a {what}")
    return data


def _frames(path, file):
    """Yields (t_ns, link type, bytes, length on the wire) of each frame."""
    magic = file.read(4)
    if magic == b"\x0a\x0d\x0d\x0a":
        yield from _pcapng_frames(path, file)
        return
    order, unit_ns = ORDER.get(magic, (None, None))
    if order is None:
        raise ValueError(f"{path}: not a pcap file")
    link = _known_link(path, struct.unpack(order + "16xI", _exactly(file, 20, "header"))[0] & 0xFFFF)
    while header := file.read(16):
        if len(header) < 16:
            raise EOFError(f"{len(header)} of 16 bytes of a record's header")
        seconds, fraction, size, length = struct.unpack(order + "4I", header)
        yield seconds * 10**9 + fraction * unit_ns, link, _exactly(file, size, "record"), length


def _known_link(path, link):
    if link not in LINKS:
        raise ValueError(f"{path}: link type {link}, expected Ethernet, Linux cooked, raw IP or BSD loopback")
    return link


def _pcapng_frames(path, file):
    kind, order, interfaces = b"\x0a\x0d\x0d\x0a", None, []
    while kind:
        if len(kind) < 4:
            raise EOFError(f"{len(kind)} of 4 bytes of a block's type")
        size = _exactly(file, 4, "block's length")
        if kind == b"\x0a\x0d\x0d\x0a":  # a section: its byte order follows
            start, interfaces = _exactly(file, 4, "section"), []
            order = "<" if start == b"\x4d\x3c\x2b\x1a" else ">"
        else:
            start = b""
        body = start + _exactly(file, struct.unpack(order + "I", size)[0] - 8 - len(start), "block")
        number = struct.unpack(order + "I", kind)[0]
        if number == 1:
            interfaces.append((struct.unpack_from(order + "H", body)[0], _ticks_per_second(order, body[8:-4])))
        elif number == 6:
            index, high, low, size, length = struct.unpack_from(order + "5I", body)
            link, ticks = interfaces[index]
            yield (high << 32 | low) * 10**9 // ticks, _known_link(path, link), body[20 : 20 + size], length
        elif number == 3:  # without a time
            length = struct.unpack_from(order + "I", body)[0]
            yield 0, _known_link(path, interfaces[0][0]), body[4 : 4 + min(length, len(body) - 8)], length
        kind = file.read(4)


def _ticks_per_second(order, options):
    """Of an interface's time stamps (option 9, if_tsresol)."""
    while len(options) >= 4:
        code, size = struct.unpack_from(order + "2H", options)
        if code == 9:
            return 2 ** (options[4] & 0x7F) if options[4] & 0x80 else 10 ** options[4]
        options = options[4 + (size + 3) // 4 * 4 :] if code else b""
    return 10**6


class _Fragments:
    """Fragments of one IP packet."""

    def __init__(self, t_ns):
        self.t_ns, self.protocol, self.data, self.has, self.size, self.is_whole = t_ns, None, bytearray(), bytearray(), None, False

    def take(self, t_ns, protocol, body, offset, is_last):
        """False: it brings nothing new. None: it is of another packet."""
        end = offset + len(body)
        if abs(t_ns - self.t_ns) > FRAGMENTS_NS:
            return None
        if self.size is not None and (end > self.size or (is_last and end != self.size)) or (is_last and len(self.data) > end):
            return None
        known = self.has[offset:end]
        if any(h and a != b for h, a, b in zip(known, self.data[offset:end], body)):
            return None
        self.t_ns = min(self.t_ns, t_ns)
        if len(known) == len(body) and all(known):
            return False
        grow = max(0, end - len(self.data))
        self.data += bytes(grow)
        self.has += bytes(grow)
        self.data[offset:end], self.has[offset:end] = body, b"\1" * len(body)
        self.protocol = protocol if offset == 0 else self.protocol
        self.size = end if is_last else self.size
        self.is_whole = self.size is not None and all(self.has)
        return True


class _Reader:
    """UDP datagrams out of frames."""

    def __init__(self):
        self.counts = Counter(frames=0, other=0, cut=0, malformed=0, repeated=0, incomplete=0)
        self.datagrams, self.fragments = [], {}

    def take(self, t_ns, link, data, length):
        self.counts["frames"] += 1
        try:
            packet = _packet(link, data)
            if packet is None or not self._add_packet(t_ns, *packet):
                self.counts["other"] += 1
        except (_Malformed, struct.error, IndexError):
            self.counts["cut" if len(data) < length else "malformed"] += 1

    def finish(self):
        self.counts["incomplete"] += sum(not f.is_whole for f in self.fragments.values())
        once, last = [], {}
        for d in sorted(self.datagrams, key=lambda d: d.t_ns):
            before, last[d.source, d.payload] = last.get((d.source, d.payload)), d.t_ns
            if before is None or d.t_ns - before > REPEATED_NS:
                once.append(d)
        self.counts["repeated"] += len(self.datagrams) - len(once)
        return once

    def _add_packet(self, t_ns, addresses, protocol, body, fragment):
        """False: it is not UDP."""
        if fragment is None:
            return self._add(t_ns, addresses, protocol, body)
        key, offset, is_last = (addresses, fragment[0]), *fragment[1:]
        if not body or offset + len(body) > 65535 or (not is_last and len(body) % 8):
            raise _Malformed
        known = self.fragments.setdefault(key, _Fragments(t_ns))
        new = known.take(t_ns, protocol, body, offset, is_last)
        if new is None:
            self.counts["incomplete"] += not known.is_whole
            known = self.fragments[key] = _Fragments(t_ns)
            new = known.take(t_ns, protocol, body, offset, is_last)
        self.counts["repeated"] += not new
        if known.is_whole and not new:
            self.datagrams[known.datagram] = self.datagrams[known.datagram]._replace(t_ns=known.t_ns)
        if not known.is_whole or not new:
            return True
        del self.fragments[key]  # unless its content can be used
        if not self._add(known.t_ns, addresses, known.protocol, bytes(known.data)):
            return False
        self.fragments[key], known.datagram = known, len(self.datagrams) - 1
        return True

    def _add(self, t_ns, addresses, protocol, body):
        protocol, body = _skip_extensions(protocol, body)
        if protocol != UDP:
            return False
        _, port, length, _ = struct.unpack_from(">4H", body)
        if not 8 <= length <= len(body):
            raise _Malformed
        address = ipaddress.ip_address(addresses[: len(addresses) // 2])
        self.datagrams.append(Datagram(t_ns, f"[{address}]" if address.version == 6 else str(address), port, body[8:length]))
        return True


def _packet(link, data):
    """(addresses, protocol, body, fragment) of a frame's IP packet; None: other traffic. fragment: None or (id, offset, is last)."""
    header, type_at = LINKS[link]
    if len(data) < header:
        raise _Malformed
    data, kind = data[header:], None if type_at is None else struct.unpack_from(">H", data, type_at)[0]
    while kind in VLAN_TYPES:
        kind, data = struct.unpack_from(">H", data, 2)[0], data[4:]
    if kind is not None and kind not in IP_TYPES:
        return None
    version = data[0] >> 4
    if version not in (4, 6):
        if kind is None:
            return None
        raise _Malformed
    return _ipv4(data) if version == 4 else _ipv6(data)


def _ipv4(data):
    total, number, flags = struct.unpack_from(">2x3H", data)
    header, total, is_last, offset = 4 * (data[0] & 15), total or len(data), not flags & 0x2000, 8 * (flags & 0x1FFF)
    if len(data) < 20:
        raise _Malformed
    if data[9] != UDP:
        return None
    if header < 20 or total < header or len(data) < total:
        raise _Malformed
    return data[12:20], UDP, data[header:total], None if is_last and offset == 0 else (number, offset, is_last)


def _ipv6(data):
    if len(data) < 40:
        raise _Malformed
    length = struct.unpack_from(">H", data, 4)[0] or len(data) - 40
    protocol, body = _skip_extensions(data[6], data[40 : 40 + length])
    fragment = None
    if protocol == FRAGMENT:
        protocol, flags, number = struct.unpack_from(">BxHI", body)
        fragment, body = (number, flags & ~7, not flags & 1), body[8:]
    if protocol != UDP and not (fragment and protocol in EXTENSIONS):
        return None
    if len(data) < 40 + length:
        raise _Malformed
    return data[8:40], protocol, body, fragment


def _skip_extensions(protocol, body):
    while protocol in EXTENSIONS:
        length = 4 * (body[1] + 2) if protocol == AUTHENTICATION else 8 * (body[1] + 1)
        if len(body) < max(8, length):
            raise _Malformed
        protocol, body = body[0], body[length:]
    return protocol, body
