#!/usr/bin/python3
"""navigation.py CHANNEL VIDEO [RATE]: holds station beside what its camera sees. The corners of its first frame are found
again in every other: shift and scale say where the chaser has drifted, the star tracker's report on CAN how it is turned.
Each control period a PD controller answers with impulses. CHANNEL: socket://127.0.0.1:29537, vcan0; VIDEO: FIFO, device"""
import os, sys, can, cv2, numpy as np
CHANNEL, VIDEO = sys.argv[1:3]
PERIOD, MASS, INERTIA = 1.0, 9500.0, np.array([22000.0, 31000.0, 31000.0])  # s, kg, kg m2: scenes/rehearsal/docking.toml
WIDTH, HEIGHT, FOCAL, RANGE = 320, 240, 386.3, 28.0  # px, px, px; m to what is seen, about
CAMERA = np.array([[0.0, 0, 1], [-1, 0, 0], [0, -1, 0]])  # camera axes to chaser axes
TURN = np.array([0.0, float(sys.argv[3]) if sys.argv[3:] else 1.1313e-3, 0])  # rad/s: of the target, as the orbit
def crc8(identifier, data, crc=0xFF):  # CRC-8/SAE-J1850
    for byte in identifier.to_bytes(2, "little") + data:
        crc ^= byte
        for _ in range(8): crc = (crc << 1 ^ 0x1D) & 0xFF if crc & 0x80 else crc << 1
    return crc ^ 0xFF
def unpacked(data, step):
    return [step * int.from_bytes(data[i:i + 3], "little", signed=True) for i in range(0, len(data), 3)]
def matrix(w, *axis):  # of a unit quaternion
    return cv2.Rodrigues(2 * np.arctan2(np.linalg.norm(axis), w) * np.array(axis) / max(np.linalg.norm(axis), 1e-12))[0]
def pictures():  # opens with the first frame
    if VIDEO.startswith("/dev/"):
        camera = cv2.VideoCapture(VIDEO, cv2.CAP_V4L2)
        while camera.set(cv2.CAP_PROP_CONVERT_RGB, 0) or True: yield camera.read()[1].reshape(HEIGHT, WIDTH)
    stream = os.fdopen(os.open(VIDEO, os.O_RDWR), "rb")
    stream.readline()  # of the stream; each frame has one of its own
    while stream.readline(): yield np.frombuffer(stream.read(WIDTH * HEIGHT), np.uint8).reshape(HEIGHT, WIDTH)
bus = can.Bus(CHANNEL, interface="slcan" if ":" in CHANNEL else "socketcan", sleep_after_open=0.1)
video, first, fit, due, report, cycle, x, v = pictures(), None, np.eye(2, 3), None, {}, 0, np.zeros(3), np.zeros(3)
print("ready", flush=True)
for message in bus:
    m, data = message.arbitration_id, bytes(message.data)
    if len(data) != 8 or crc8(m, data[:7]) != data[7]: continue
    if m == 0x752 and data[0] & 15 == 3: break  # dynamics: finished
    if m == 0x609 and data[5] >> 2 & 3 != 1:  # ledger of camera 0: a frame was handed over
        picture = next(video)
        if first is None and (due is None or int.from_bytes(report[0x601], "little") < due): continue  # exposed too early
        if first is None: first, corners = picture, cv2.goodFeaturesToTrack(picture, 200, 0.02, 6)
        now, found, _ = cv2.calcOpticalFlowPyrLK(first, picture, corners, cv2.transform(corners, fit), winSize=(25, 25),
                                                 maxLevel=2, flags=cv2.OPTFLOW_USE_INITIAL_FLOW)
        fit, same = cv2.estimateAffinePartial2D(corners[found == 1], now[found == 1], ransacReprojThreshold=1.0)
        centre = (fit @ [WIDTH / 2, HEIGHT / 2, 1] - [WIDTH / 2, HEIGHT / 2]) / FOCAL
        seen = RANGE / np.hypot(fit[0, 0], fit[1, 0]) * np.append(centre, 1)  # the target, camera axes
    if 0x740 <= m <= 0x744 or m == 0x601: report[m] = data[:6]  # attitude report, exposure
    if m == 0x744: due = int.from_bytes(report[0x740], "little")
    if m != 0x701 or due is None or first is None or data[5] & 15 == 0: continue
    if int.from_bytes(data[:5], "little") * 1000 + 1000 <= due: continue  # the emulator is not there yet
    R, rate = matrix(*unpacked(report[0x741] + report[0x742], 2**-22)), unpacked(report[0x743] + report[0x744][:3], 1e-6)
    R0, t0 = (R, due) if cycle == 0 else (R0, t0)
    wanted = cv2.Rodrigues(TURN * (due - t0) * 1e-9)[0] @ R0
    turned = cv2.Rodrigues(wanted.T @ R)[0].ravel()  # off the attitude that it should have
    missed = wanted.T @ R @ CAMERA @ seen - [RANGE, 0, 0] - (x + v * PERIOD)  # of where it was foreseen
    x, v = x + v * PERIOD + 0.6 * missed, v + 0.3 * missed / PERIOD
    impulse = np.clip(MASS * PERIOD * (0.12**2 * x + 2 * 0.9 * 0.12 * v), -300, 300)
    torque = np.clip(-INERTIA * PERIOD * (0.25**2 * turned + 2 * 0.9 * 0.25 * (rate - R.T @ TURN)), -300, 300)
    codes = b"".join(round(1e3 * n).to_bytes(3, "little", signed=True) for n in (*impulse, *torque)) + b"\0\1\0\0\0\0"
    for i, part in enumerate((due.to_bytes(6, "little") + codes)[k:k + 6] + bytes([cycle % 256]) for k in range(0, 30, 6)):
        bus.send(can.Message(arbitration_id=0x720 + i, is_extended_id=False, data=part + bytes([crc8(0x720 + i, part)])))
    print(f"{cycle:4d}: off by {np.round(x, 3)} m, {np.round(np.degrees(turned), 2)} deg, {same.sum()} corners", flush=True)
    v, cycle, due = v - impulse / MASS, cycle + 1, None
