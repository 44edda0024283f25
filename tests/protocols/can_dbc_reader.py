"""Reads narpa.dbc with canmatrix, knowing nothing else of the wire but its checksums (protocols/can/README.md).

encode C,T,PX,..,RZ ...   counter, time and 13 physical values; prints ten candump lines each: nine classic, one FD
decode 123#0011.. ...     prints "message.signal value" lines
Exit status 77: canmatrix is not installed.
"""
import decimal
import logging
import sys

logging.disable(logging.WARNING)
try:
    import canmatrix.formats
except ImportError as error:
    print(error)
    sys.exit(77)

QUANTITIES = ("Time PositionX PositionY PositionZ AttitudeW AttitudeX AttitudeY AttitudeZ "
              "VelocityX VelocityY VelocityZ RateX RateY RateZ").split()


def crc(data, bits, polynomial, start, final):
    value = start
    for byte in data:
        value ^= byte << (bits - 8)
        for _ in range(8):
            value = (value << 1) ^ (polynomial if value >> (bits - 1) else 0)
            value &= (1 << bits) - 1
    return value ^ final


def message_bytes(message, values):
    raw = {}
    for signal in message.signals:
        if signal.name == "Crc":
            continue
        physical = decimal.Decimal(values[signal.name])
        raw[signal.name] = int((physical / signal.factor).quantize(0, decimal.ROUND_HALF_UP))
        assert signal.min <= physical <= signal.max, signal.name
    data = bytes(message.encode(raw))
    covered = message.arbitration_id.id.to_bytes(2, "little")
    if message.is_fd:
        return data[:62] + crc(covered + data[:62], 16, 0x1021, 0xFFFF, 0).to_bytes(2, "little")
    return data[:7] + bytes([crc(covered + data[:7], 8, 0x1D, 0xFF, 0xFF)])


def main():
    matrix = canmatrix.formats.loadp_flat(sys.argv[1])
    decimal.getcontext().prec = 40
    if sys.argv[2] == "encode":
        for argument in sys.argv[3:]:
            counter, *numbers = argument.split(",")
            values = dict(zip(QUANTITIES, numbers), Counter=counter)
            for offset in (*range(9), 15):
                message = matrix.frame_by_id(canmatrix.ArbitrationId(0x100 + offset, extended=False))
                mark = "##1" if message.is_fd else "#"
                print("(0.0) can0 %03X%s%s" % (0x100 + offset, mark, message_bytes(message, values).hex()))
    else:
        for argument in sys.argv[3:]:
            number, data = argument.split("#", 1)
            data = bytes.fromhex(data[2:] if data.startswith("#") else data)
            message = matrix.frame_by_id(canmatrix.ArbitrationId(int(number, 16), extended=False))
            assert message.is_fd == (len(data) > 8), "VFrameFormat"
            for name, value in message.decode(data).items():
                text = value.named_value if value.signal.values else "{:f}".format(value.phys_value.normalize())
                print("%s.%s %s" % (message.name, name, text))


main()
