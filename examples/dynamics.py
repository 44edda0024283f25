#!/usr/bin/python3
"""dynamics.py CHANNEL [SECONDS]: flies the chaser in lockstep, on socket://127.0.0.1:29537 or vcan0. A rigid body without
an attractor, that does as the actuator commands say; the target rests. Each control period: report and star tracker, poses,
waiting for the command; then poses up to the next one."""
import math, sys, time, can, numpy as np

CHANNEL, SECONDS = sys.argv[1], float(sys.argv[2]) if len(sys.argv) > 2 else 60.0
PERIOD, STEPS, MASS, INERTIA = 1.0, 5, 9500.0, np.array([22000.0, 31000.0, 31000.0])  # s, poses a period, kg, kg m2
CHASER, REST = 0x100, {0x110: (12.0, 0, 0), 0x120: (0, 0, -6778137.0)}  # can_ids; where the target and the Earth rest
position, velocity = np.array([37.0, 1.0, -0.8]), np.array([0.01, 0.02, -0.01])  # m, m/s, world axes
attitude, rate = np.array([0.0, 0, 0, 1]), np.array([0.0003, -0.0002, 0.0002])  # w x y z, body to world; rad/s, body

def crc8(identifier, data, crc=0xFF):  # CRC-8/SAE-J1850
    for byte in identifier.to_bytes(2, "little") + data:
        crc ^= byte
        for _ in range(8): crc = (crc << 1 ^ 0x1D) & 0xFF if crc & 0x80 else crc << 1
    return crc ^ 0xFF
def send(base, counter, frames):  # frames of (value, bits), the lowest bits first
    for m, signals in enumerate(frames, base):
        payload = start = 0
        for value, bits in signals: payload, start = payload | round(value) % 2**bits << start, start + bits
        data = payload.to_bytes(6, "little") + bytes([counter % 256])
        bus.send(can.Message(arbitration_id=m, is_extended_id=False, data=data + bytes([crc8(m, data)])))
def pairs(values, scale): return [[(n * scale, 24) for n in values[i:i + 2]] for i in range(0, len(values), 2)]
def send_pose(base, t_ns, p, q, v, w):
    motion = [[(a * 5e4, 30), (b * 5e4, 18)] for a, b in zip(v, w)]
    send(base, t_ns // 100_000_000, [[(t_ns, 48)], *([(n * 1e6, 48)] for n in p), *pairs(q, 2**22), *motion])
def product(a, b):  # of quaternions
    return np.append(a[0] * b[0] - a[1:] @ b[1:], a[0] * b[1:] + b[0] * a[1:] + np.cross(a[1:], b[1:]))
def command(t_ns, patience_s=60.0):  # impulse and angular impulse for this time
    got, until = {}, time.monotonic() + patience_s
    while time.monotonic() < until:
        message = bus.recv(1.0)
        m, data = (message.arbitration_id, bytes(message.data)) if message else (0, b"")
        if not 0x720 <= m <= 0x724 or len(data) != 8 or crc8(m, data[:7]) != data[7]: continue
        got[m] = data
        if len(got) < 5 or len({data[6] for data in got.values()}) > 1: continue  # parts of two commands
        if int.from_bytes(got[0x720][:6], "little") == t_ns:
            numbers = b"".join(got[m][:6] for m in (0x721, 0x722, 0x723))
            return np.array([int.from_bytes(numbers[i:i + 3], "little", signed=True) * 1e-3 for i in range(0, 18, 3)])
    sys.exit(f"no actuator command for {t_ns * 1e-9} s within {patience_s} s")

bus = can.Bus(CHANNEL, interface="slcan" if ":" in CHANNEL else "socketcan", sleep_after_open=0.1)
for k in range(int(SECONDS / PERIOD * STEPS) + 1):
    t_ns, over = round(k * PERIOD / STEPS * 1e9), k == int(SECONDS / PERIOD * STEPS)
    if k % STEPS == 0:
        send(0x750, k // STEPS, [[(t_ns, 48)], [(0, 48)], [(3 if over else 0, 4)]])  # 0 flying, 3 finished
        send(0x740, k // STEPS, [[(t_ns, 48)], *pairs(attitude, 2**22), *pairs(rate, 1e6)])
    for body, place in REST.items(): send_pose(body, t_ns, place, (1, 0, 0, 0), (0, 0, 0), (0, 0, 0))
    send_pose(CHASER, t_ns, position, attitude, velocity, rate)
    if k % STEPS == 0 and not over:
        impulse = command(t_ns)
        turned = product(product(attitude, np.append(0, impulse[:3])), attitude * [1, -1, -1, -1])[1:]  # to world axes
        velocity, rate = velocity + turned / MASS, rate + impulse[3:] / INERTIA
        print(f"{k // STEPS}: {np.round(position, 3)} m, {np.round(velocity, 3)} m/s, {np.round(impulse, 1)}", flush=True)
    position, half = position + velocity * PERIOD / STEPS, rate * PERIOD / STEPS / 2
    attitude = product(attitude, np.append(1, half)) / math.sqrt(1 + half @ half)
bus.shutdown()
