#!/usr/bin/python3
"""ffmpeg and OpenCV read narpa's video files and FIFOs byte for byte."""
import importlib.util
import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

import support
from support import expect

if not shutil.which("ffmpeg") or not importlib.util.find_spec("cv2"):
    support.skip("no ffmpeg or no OpenCV for Python; try: apt-get install ffmpeg python3-opencv")

POSES = support.flight(4)
FFMPEG_RAW = {"GREY": "gray", "Y16": "gray16le", "YUYV": "yuyv422"}


def await_open(process, path):
    """Waits until the process has opened the path; opening a FIFO blocks until there is a writer."""
    files = Path(f"/proc/{process.pid}/fd")
    for _ in range(600):
        if any(os.path.realpath(file) == str(path) for file in files.iterdir()):
            return
        if process.poll() is not None:
            break
        time.sleep(0.05)
    expect(False, f"{process.args[0]} opens {path}")


def fly(scene, sinks, await_reader):
    """Commands the poses in lockstep; frame i shows POSES[i]."""
    wire, port = support.Wire(), support.free_port()
    video = [word for sink in sinks for word in ("--video", f"{support.CAMERA}={sink}")]
    with support.Run(scene, "--can", f"slcan:{port}", *video, "--lockstep") as run:
        bus = support.open_bus(run, interface="slcan", channel=f"socket://127.0.0.1:{port}", sleep_after_open=0.1)
        for frame, pose in enumerate(POSES):
            for message in wire.command(pose, frame * support.PERIOD_NS, counter=frame):
                bus.send(message)
            support.await_ledger(bus, wire, frame)
        await_reader()  # narpa ends one second after the bus is closed, even without a reader
        bus.shutdown()
        return run.stop()


def rendered(scene, folder):
    return [support.render(scene, frame, pose, folder) for frame, pose in enumerate(POSES)]


def split(data, size):
    return [data[i : i + size] for i in range(0, len(data), size)]


def start_ffmpeg(path, pixel_format, out):
    """Starts ffmpeg, given only the file's name, to convert to the layout of narpa's raw frames."""
    command = ["ffmpeg", "-v", "error", "-nostdin", "-i", path, "-f", "rawvideo", "-fps_mode", "passthrough"]
    return subprocess.Popen([*command, "-pix_fmt", FFMPEG_RAW[pixel_format], out])


OPENCV_READER = """
import cv2, sys
video = cv2.VideoCapture(sys.argv[1], cv2.CAP_FFMPEG)
out = open(sys.argv[2], "wb")
while True:
    good, picture = video.read()
    if not good: break
    blue, green, red = cv2.split(picture)
    assert (blue == green).all() and (green == red).all(), "grey came out coloured"
    out.write(blue.tobytes())
"""


def start_opencv(path, _, out):
    return subprocess.Popen([sys.executable, "-c", OPENCV_READER, path, out])


def check(tool, start_reader, pixel_format):
    """The tool reads a FIFO while frames are rendered, and also the file with the same frames."""
    folder = support.work_folder()
    scene = support.scene_with(folder, pixel_format)
    size = support.WIDTH * support.HEIGHT * support.PIXEL_BYTES[pixel_format]
    file, fifo = folder / "nav.y4m", folder / "nav.fifo"
    os.mkfifo(fifo)
    at_fifo = start_reader(fifo, pixel_format, folder / "from_fifo")
    summary = fly(scene, [file, fifo], lambda: await_open(at_fifo, fifo))
    print(f"{tool}, {pixel_format}: {summary['cameras'][0]['sinks']}")
    at_file = start_reader(file, pixel_format, folder / "from_file")
    wanted = rendered(scene, folder)
    for source, reader in ("fifo", at_fifo), ("file", at_file):
        expect(reader.wait(timeout=600) == 0, f"{tool} ends well")
        got = (folder / f"from_{source}").read_bytes()
        support.expect_frames(split(got, size), wanted, f"{tool}, {pixel_format}, {source}")


for pixel_format in FFMPEG_RAW:
    check("ffmpeg", start_ffmpeg, pixel_format)
check("OpenCV", start_opencv, "GREY")
