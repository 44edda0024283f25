#!/usr/bin/python3
"""GStreamer, ffmpeg, OpenCV and the Python package read the sink rtp: of a run, all at once: every pixel of every frame, and of a
network that loses packets every row that came, in its place."""
import importlib.util
import re
import shutil
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np

import support
from support import expect

from narpa import rtp  # noqa: E402  (support sets the path)

WIDTH, HEIGHT = 640, 480
RATE_HZ, MBIT_S = 2, 24  # a frame of 4:2:2 in 16 bits is 10 Mbit: the receivers share the processors with narpa
support.PERIOD_NS = 1_000_000_000 // RATE_HZ
POSES = support.flight(10)
LOST = 0.01  # of the packets

# Bits of the ADC, and of the pixels on the wire.
BITS = {"GREY": (12, 8), "Y10": (10, 10), "Y12": (12, 12), "Y16": (12, 16), "YUYV": (12, 8), "RGB24": (12, 8)}

# The elements of a packet as they came: OpenCV would convert to BGR.
OPENCV_READER = """
import cv2, os, sys
os.environ["OPENCV_FFMPEG_CAPTURE_OPTIONS"] = "protocol_whitelist;file,udp,rtp"
video = cv2.VideoCapture(sys.argv[1], cv2.CAP_FFMPEG)
assert video.set(cv2.CAP_PROP_FORMAT, -1)
with open(sys.argv[2], "wb") as out:
    while True:
        good, packet = video.read()
        if not good: break
        out.write(packet.tobytes())
        out.flush()
"""


def has_gstreamer():
    return shutil.which("gst-inspect-1.0") and subprocess.run(["gst-inspect-1.0", "--exists", "rtpvrawdepay"]).returncode == 0


def readers(pixel_format):
    """Name of each reader that this machine has and that reads the format, and its command for an SDP file, a session and a file of
    frames."""
    def gstreamer(_, session, out):
        caps = ("application/x-rtp,media=video,clock-rate=90000,encoding-name=RAW,payload=96,"
                f"sampling={session.sampling},depth=(string){session.depth},width=(string)640,height=(string)480")  # fmt: skip
        return ["gst-launch-1.0", "-q", "udpsrc", "address=127.0.0.1", f"port={session.port}", "buffer-size=8388608", f"caps={caps}",
                "!", "rtpvrawdepay", "!", "filesink", f"location={out}", "buffer-mode=unbuffered", "sync=false"]  # fmt: skip

    def ffmpeg(sdp, _, out):
        wanted = {"Y10": "yuv422p10le", "RGB24": "rgb24"}.get(pixel_format, "uyvy422")
        return ["ffmpeg", "-v", "error", "-nostdin", "-threads", "1", "-protocol_whitelist", "file,udp,rtp", "-buffer_size", "8388608", "-i", sdp, "-f", "rawvideo",
                "-flush_packets", "1", "-fps_mode", "passthrough", "-pix_fmt", wanted, out]  # fmt: skip

    def opencv(sdp, _, out):
        return [sys.executable, "-c", OPENCV_READER, sdp, out]

    found = {}
    if pixel_format in ("Y12", "Y16"):  # none of them reads these depths
        return found
    if has_gstreamer():
        found["GStreamer"] = gstreamer
    if shutil.which("ffmpeg"):
        found["ffmpeg"] = ffmpeg
    if importlib.util.find_spec("cv2") and pixel_format == "GREY":
        found["OpenCV"] = opencv
    return found


def frame_size(reader, pixel_format):
    """Bytes of a frame in the reader's file."""
    return WIDTH * HEIGHT * 2 if pixel_format != "Y10" and pixel_format != "RGB24" else \
        WIDTH * HEIGHT * 3 if pixel_format == "RGB24" else WIDTH * HEIGHT * 5 // 2 if reader == "GStreamer" else WIDTH * HEIGHT * 4  # fmt: skip


def pixels_read(reader, pixel_format, data):
    """What is compared, of the bytes of a frame in the reader's file: height x width of luma, or height x width x components."""
    if pixel_format == "RGB24":
        return np.frombuffer(data, np.uint8).reshape(HEIGHT, WIDTH, 3)
    if pixel_format == "Y10" and reader == "ffmpeg":  # planes: Y, Cb, Cr
        values = np.frombuffer(data, "<u2")
        expect((values[WIDTH * HEIGHT :] == 512).all(), "the chroma is that of grey")
        return values[: WIDTH * HEIGHT].reshape(HEIGHT, WIDTH)
    if pixel_format == "Y10":  # GStreamer's UYVP: groups as in the packets
        bits = np.unpackbits(np.frombuffer(data, np.uint8)).reshape(-1, 4, 10)
        return (bits @ (1 << np.arange(9, -1, -1)))[:, 1::2].reshape(HEIGHT, WIDTH)
    values = np.frombuffer(data, np.uint8).reshape(HEIGHT, WIDTH, 2)  # of a pixel: Cb or Cr, then Y
    return values[:, :, ::-1] if pixel_format == "YUYV" else values[:, :, 1]


def pixels_rendered(pixel_format, data):
    if pixel_format == "GREY":
        return np.frombuffer(data, np.uint8).reshape(HEIGHT, WIDTH)
    if pixel_format in ("YUYV", "RGB24"):
        return np.frombuffer(data, np.uint8).reshape(HEIGHT, WIDTH, -1)
    return np.frombuffer(data, "<u2").reshape(HEIGHT, WIDTH) >> (16 - BITS[pixel_format][1])


def pixels_of_frame(pixel_format, frame):
    """The same of a frame that narpa.rtp has put together."""
    if pixel_format != "YUYV":
        return frame.planes
    return np.stack([frame.planes, frame.chroma.reshape(HEIGHT, WIDTH)], axis=2)


def free_port():
    """An even port and the one after it, which ffmpeg takes for RTCP."""
    while True:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as s, socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as t:
            s.bind(("127.0.0.1", 0))
            port = s.getsockname()[1] & ~1
            if port in free_port.given:
                continue
            try:
                t.bind(("127.0.0.1", port + 1))
            except OSError:
                continue
            free_port.given.add(port)
            return port


free_port.given = set()


def listens(port):
    return any(line.split()[1].endswith(f":{port:04X}") for line in Path("/proc/net/udp").read_text().splitlines()[1:])


class Relay(threading.Thread):
    """Forwards packets from a port to another, and loses some; those of the last frame all arrive, so that readers end."""

    def __init__(self, seed):
        super().__init__(daemon=True)
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 8 << 20)
        self.port = free_port()
        self.socket.bind(("127.0.0.1", self.port))
        self.random, self.session, self.to, self.lost = np.random.default_rng(seed), None, None, {}

    def run(self):
        while True:
            data = self.socket.recv(65536)
            packet = rtp.decode(data, self.session)
            if packet.frame < len(POSES) - 1 and self.random.random() < LOST:
                self.lost.setdefault(packet.frame, set()).update(row for row, _, _ in packet.parts)
            else:
                self.socket.sendto(data, ("127.0.0.1", self.to))


def scene_of(folder, pixel_format):
    scene = support.scene_with(folder, pixel_format)
    text = scene.read_text()
    for old, new in (("resolution = [160, 120]", f"resolution = [{WIDTH}, {HEIGHT}]"), ("rate_hz = 10\nformat", f"rate_hz = {RATE_HZ}\nformat"),
                     ("bits = 12", f"bits = {BITS[pixel_format][0]}")):  # fmt: skip
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    scene.write_text(text)
    return scene


def check(pixel_format, poses, loses=False):
    """Returns the names of the readers."""
    folder, can_port = support.work_folder(), support.free_port()
    scene = scene_of(folder, pixel_format)
    commands = readers(pixel_format)
    names = [*commands, "narpa.rtp"]
    # With losses narpa sends to a relay, which forwards to the reader's port.
    relays = {name: Relay(len(name)) for name in names} if loses else {}
    ports = {name: free_port() for name in names}
    sdp = {name: folder / f"{name}.sdp" for name in names}
    videos = [f"{support.CAMERA}=rtp:127.0.0.1:{relays[n].port if loses else ports[n]},sdp={sdp[n]},mbit_s={MBIT_S}" for n in names]
    frames = []
    with support.Run(scene, "--can", f"slcan:{can_port}", "--lockstep", *(part for v in videos for part in ("--video", v))) as run:
        run.wait_for(re.escape(f"file,udp,rtp {sdp['narpa.rtp']}"))
        for name in names:
            if loses:
                sdp[name].write_text(sdp[name].read_text().replace(f"m=video {relays[name].port} ", f"m=video {ports[name]} "))
        sessions = {name: rtp.read_sdp(sdp[name].read_text()) for name in names}
        for name, relay in relays.items():
            relay.session, relay.to = sessions[name], ports[name]
            relay.start()
        started = {n: subprocess.Popen(list(map(str, make(sdp[n], sessions[n], folder / n)))) for n, make in commands.items()}
        threading.Thread(target=lambda: frames.extend(rtp.receive(sessions["narpa.rtp"], timeout_s=60)), daemon=True).start()
        for _ in range(600):
            if all(listens(port) for port in ports.values()):
                break
            time.sleep(0.1)
        expect(all(listens(port) for port in ports.values()), f"{pixel_format}: {', '.join(names)} listen")
        time.sleep(3)  # a reader has its port before it reads
        support.command_frames(run, can_port, poses, pause_s=1.5)  # the readers share the processors with narpa
        print(run.stop()["cameras"][0]["sinks"])
    wanted = [pixels_rendered(pixel_format, support.render(scene, frame, pose, folder)) for frame, pose in enumerate(poses)]
    for _ in range(300):  # what is still on the way
        if len(frames) == len(wanted) and all((folder / n).exists() and (folder / n).stat().st_size >= len(wanted) * frame_size(n, pixel_format) for n in started):
            break
        time.sleep(0.1)
    for reader in started.values():
        reader.terminate()
        reader.wait(timeout=60)

    expect([f.number for f in frames] == list(range(len(wanted))), f"narpa.rtp, {pixel_format}: all {len(wanted)} frames, in order")
    times = [f.t_ns for f in frames]
    expect(all(b - a == support.PERIOD_NS for a, b in zip(times, times[1:])), f"narpa.rtp, {pixel_format}: exact times of validity")
    expect(all(f.timestamp == (f.t_ns * 9 // 100_000 % 2**32 or 1) for f in frames), f"narpa.rtp, {pixel_format}: time stamps of 90 kHz")
    got = {"narpa.rtp": [pixels_of_frame(pixel_format, f) for f in frames]}
    for name in started:
        data, size = (folder / name).read_bytes(), frame_size(name, pixel_format)
        expect(len(data) == len(wanted) * size, f"{name}, {pixel_format}: {len(data) / size} frames, expected {len(wanted)}")
        got[name] = [pixels_read(name, pixel_format, data[i : i + size]) for i in range(0, len(data), size)]
    for name, pictures in got.items():
        lost = relays[name].lost if loses else {}
        expect(bool(lost) == loses, f"{name}, {pixel_format}: {sum(map(len, lost.values()))} rows are lost on the way")
        for number, (a, b) in enumerate(zip(pictures, wanted)):
            came = np.array([row not in lost.get(number, ()) for row in range(HEIGHT)])
            wrong = [row for row in np.flatnonzero(came) if not np.array_equal(a[row], b[row])]
            if wrong:
                expect(False, f"{name}, {pixel_format}: frame {number} has {len(wrong)} wrong rows of {came.sum()} that came: {wrong[:8]}")
            if name == "narpa.rtp":
                expect(np.array_equal(frames[number].came.all(axis=1), came), f"{name}, {pixel_format}: frame {number} names the rows that are lost")
        distinct = len({w.tobytes() for w in wanted})
        expect(distinct == len(wanted), f"{name}, {pixel_format}: every row that came of {len(wanted)} frames is right, {distinct} distinct")
    return set(commands)


missing = {"GStreamer", "ffmpeg", "OpenCV"} - check("GREY", POSES)
check("GREY", POSES, loses=True)
for name in ("Y10", "RGB24", "YUYV", "Y12", "Y16"):
    check(name, POSES[:4])
for name in sorted(missing):
    print(f"SKIP: no {name}; try: apt-get install ffmpeg python3-opencv gstreamer1.0-tools gstreamer1.0-plugins-good")
