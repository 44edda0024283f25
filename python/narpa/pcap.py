"""Captures of Ethernet frames (pcap), as `narpa run --lidar LIDAR=FILE.pcap` and tcpdump write them."""
import struct

ORDER = {b"\xd4\xc3\xb2\xa1": "<", b"\x4d\x3c\xb2\xa1": "<", b"\xa1\xb2\xc3\xd4": ">", b"\xa1\xb2\x3c\x4d": ">"}


def udp_payloads(path):
    """Yields the payloads of the UDP datagrams of a capture."""
    with open(path, "rb") as file:
        order = ORDER.get(file.read(4))
        if order is None:
            raise ValueError(f"{path}: not a pcap file")
        file.read(20)
        while len(header := file.read(16)) == 16:
            payload = _udp_payload(file.read(struct.unpack(order + "4I", header)[2]))
            if payload is not None:
                yield payload


def _udp_payload(frame):
    """The UDP payload of an Ethernet frame with IPv4; None for other frames."""
    if frame[12:14] != b"\x08\x00" or len(frame) < 42 or frame[23] != 17:
        return None
    start = 14 + 4 * (frame[14] & 15)
    return frame[start + 8 : start + struct.unpack_from(">H", frame, start + 4)[0]]
