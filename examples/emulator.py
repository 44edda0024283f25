#!/usr/bin/python3
"""emulator.py CHANNEL FIFO: stands in for the camera, in lockstep, on a CAN FD bus: vcan0, or the UDP group 239.74.163.2.
Once the chaser's pose has come (it is the last), every frame that is due by its time is told in a ledger and written to the
FIFO as Y4M, black; then the heartbeat says how far it is. Draw your own picture where it is black."""
import sys, can

CHANNEL, FIFO = sys.argv[1:3]
WIDTH, HEIGHT, PERIOD_NS, CHASER = 320, 240, 1_000_000_000, 0x100

def crc(data, bits, polynomial, value, final):
    for byte in data:
        value ^= byte << bits - 8
        for _ in range(8): value = (value << 1 ^ (polynomial if value >> bits - 1 else 0)) & (1 << bits) - 1
    return value ^ final
def crc8(m, data): return crc(m.to_bytes(2, "little") + data, 8, 0x1D, 0xFF, 0xFF)  # CRC-8/SAE-J1850, classic frames
def crc16(m, data): return crc(m.to_bytes(2, "little") + data, 16, 0x1021, 0xFFFF, 0)  # CRC-16/IBM-3740, CAN FD
def send(base, counter, frames):  # frames of (value, bits), the lowest bits first
    for m, signals in enumerate(frames, base):
        payload = start = 0
        for value, bits in signals: payload, start = payload | value % 2**bits << start, start + bits
        data = payload.to_bytes(6, "little") + bytes([counter % 256])
        bus.send(can.Message(arbitration_id=m, is_extended_id=False, data=data + bytes([crc8(m, data)])))
def tell(frame, t_ns):  # the ledger of a frame: exposed at t_ns, handed over at once, one sample for each pixel
    times = [[(0, 24), (0, 24)], [(0, 24), (0, 24)], [(1, 24), (PERIOD_NS // 1000, 24)]]  # us after t_ns
    quality, samples, rays = [(0, 24), (256, 24)], [(WIDTH * HEIGHT, 40)], [(0, 40), (0b110, 3)]  # in time, pose known
    head = [[(frame, 32), (0, 8), (frame, 8)], [(t_ns, 48)], [(t_ns, 48)]]
    send(0x600, frame, [*head, *times, quality, samples, rays, [(1, 40)]])
def beat(t_ns): send(0x701, t_ns // PERIOD_NS, [[(t_ns // 1000, 40), (2, 4)]])  # 2: lockstep
def chaser_time(message):  # of a whole pose command in one CAN FD frame; None: something else
    m, data = message.arbitration_id, bytes(message.data)
    if m == CHASER + 15 and len(data) == 64 and crc16(m, data[:62]) == int.from_bytes(data[62:], "little"):
        return int.from_bytes(data[:6], "little")

if CHANNEL[0].isdigit(): bus = can.Bus(CHANNEL, interface="udp_multicast")
else: bus = can.Bus(CHANNEL, interface="socketcan", fd=True)
print("ready", flush=True)
video, frame, finished = None, 0, False
for message in bus:
    t_ns = chaser_time(message)
    finished = finished or (message.arbitration_id == 0x75F and message.data[12] & 15 == 3)  # dynamics: the last word
    if t_ns is None: continue
    while frame * PERIOD_NS <= t_ns:
        tell(frame, frame * PERIOD_NS)
        if video is None:
            video = open(FIFO, "wb", buffering=0)  # waits for a reader
            video.write(b"YUV4MPEG2 W%d H%d F1:1 Ip A1:1 Cmono\n" % (WIDTH, HEIGHT))
        picture = b"FRAME\n" + bytes(WIDTH * HEIGHT)
        try:
            while picture: picture = picture[video.write(picture):]
        except BrokenPipeError: print("nobody reads any more")
        frame += 1
    beat(t_ns)
    print(f"{t_ns * 1e-9:8.2f} s, {frame} frames", flush=True)
    if finished: break
