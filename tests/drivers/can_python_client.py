"""python-can as a stranger on the bus: can_python_client.py INTERFACE CHANNEL

Sends frames of every kind; each has to come back with the lowest bit of its identifier turned over. Exit status 77:
python-can is not installed.
"""
import sys
import time

try:
    import can
    if sys.argv[1] == "slcan":
        import serial
    else:
        import msgpack
except ImportError as error:
    print(error)
    sys.exit(77)

KINDS = [
    dict(arbitration_id=0x123, is_extended_id=False, data=b"\xde\xad\xbe\xef"),
    dict(arbitration_id=0x7FE, is_extended_id=False, data=b""),
    dict(arbitration_id=0x000, is_extended_id=False, data=bytes(range(8))),
    dict(arbitration_id=0x18FF50E5, is_extended_id=True, data=b"\x01"),
    dict(arbitration_id=0x12, is_extended_id=True, data=b"\x02\x03"),
    dict(arbitration_id=0x321, is_extended_id=False, is_remote_frame=True, dlc=4),
    dict(arbitration_id=0x321, is_extended_id=True, is_remote_frame=True, dlc=8),
]
FD_KINDS = [
    dict(arbitration_id=0x10E, is_extended_id=False, is_fd=True, bitrate_switch=True, data=bytes(range(64))),
    dict(arbitration_id=0x18FF50E5, is_extended_id=True, is_fd=True, data=bytes(12)),
]

PATIENCE_S = 60.0  # ends a test that would hang; a loaded machine may need seconds


def answer(bus, sent, seconds=PATIENCE_S):
    """The next frame that is not our own: udp_multicast gives a sender its own frames too."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        got = bus.recv(0.2)
        if got is not None and (sent is None or got.arbitration_id != sent.arbitration_id):
            return got
    return None


def check(bus, kind):
    sent = can.Message(check=True, **kind)
    datagrams = sys.argv[1] != "slcan"  # they may be lost
    for _ in range(5 if datagrams else 1):
        bus.send(sent)
        got = answer(bus, sent, 4.0 if datagrams else PATIENCE_S)
        if got is not None:
            break
    assert got is not None, "no answer to %r" % sent
    for field in ("is_extended_id", "is_remote_frame", "is_error_frame", "is_fd", "bitrate_switch", "dlc"):
        assert getattr(got, field) == getattr(sent, field), (field, sent, got)
    assert got.arbitration_id == sent.arbitration_id ^ 1, (sent, got)
    assert bytes(got.data) == bytes(sent.data), (sent, got)


def main():
    interface, channel = sys.argv[1:3]
    options = dict(sleep_after_open=0.1, bitrate=500000) if interface == "slcan" else {}
    bus = can.Bus(interface=interface, channel=channel, **options)
    for kind in KINDS + (FD_KINDS if interface == "udp_multicast" else []):
        check(bus, kind)
    if interface == "slcan":
        assert bus.get_version(PATIENCE_S) == (10, 13), "V"
        assert bus.get_serial_number(PATIENCE_S) is not None, "N"
        n = 3000
        for i in range(n):
            bus.send(can.Message(arbitration_id=0x100, is_extended_id=False, data=i.to_bytes(8, "little")))
        numbers = []
        while len(numbers) < n:
            got = answer(bus, None)
            if got is None:
                break
            numbers.append(int.from_bytes(got.data, "little"))
        print("burst %d of %d" % (len(numbers), n))
        assert numbers == list(range(n)), "order"
    bus.shutdown()
    print("ok")


main()
