#!/usr/bin/python3
"""ffmpeg and OpenCV read narpa's video files and FIFOs byte for byte."""
import importlib.util
import os
import shutil
import subprocess
import sys

import support

if not shutil.which("ffmpeg") or not importlib.util.find_spec("cv2"):
    support.skip("no ffmpeg or no OpenCV for Python; try: apt-get install ffmpeg python3-opencv")

POSES = support.flight(4)
FFMPEG_RAW = {"GREY": "gray", "Y16": "gray16le", "YUYV": "yuyv422"}


def fly(scene, sinks):
    """Commands the poses in lockstep; frame i shows POSES[i]."""
    wire, port = support.Wire(), support.free_port()
    video = [word for sink in sinks for word in ("--video", f"{support.CAMERA}={sink}")]
    with support.Run(scene, "--can", f"slcan:{port}", *video, "--lockstep") as run:
        bus = support.open_bus(run, interface="slcan", channel=f"socket://127.0.0.1:{port}", sleep_after_open=0.1)
        for frame, pose in enumerate(POSES):
            for message in wire.command(pose, frame * support.PERIOD_NS, counter=frame):
                bus.send(message)
            support.await_ledger(bus, wire, frame)
        bus.shutdown()
        return run.stop()


def rendered(scene, folder):
    return [support.render(scene, frame, pose, folder) for frame, pose in enumerate(POSES)]


def split(data, size):
    return [data[i : i + size] for i in range(0, len(data), size)]


def start_ffmpeg(path, pixel_format):
    """ffmpeg, told nothing but the file's name, repacking to the layout of narpa's raw frames."""
    command = ["ffmpeg", "-v", "error", "-nostdin", "-i", path, "-f", "rawvideo", "-fps_mode", "passthrough"]
    return subprocess.Popen([*command, "-pix_fmt", FFMPEG_RAW[pixel_format], "-"], stdout=subprocess.PIPE)


OPENCV_READER = """
import cv2, sys
video = cv2.VideoCapture(sys.argv[1], cv2.CAP_FFMPEG)
while True:
    good, picture = video.read()
    if not good: break
    blue, green, red = cv2.split(picture)
    assert (blue == green).all() and (green == red).all(), "grey came out coloured"
    sys.stdout.buffer.write(blue.tobytes())
"""


def start_opencv(path):
    return subprocess.Popen([sys.executable, "-c", OPENCV_READER, path], stdout=subprocess.PIPE)


def check_format(pixel_format):
    folder = support.work_folder()
    scene = support.scene_with(folder, pixel_format)
    size = support.WIDTH * support.HEIGHT * support.PIXEL_BYTES[pixel_format]
    file, fifo = folder / "nav.y4m", folder / "nav.fifo"
    os.mkfifo(fifo)
    at_fifo = start_ffmpeg(fifo, pixel_format)
    summary = fly(scene, [file, fifo])
    from_fifo = at_fifo.communicate(timeout=30)[0]
    from_file = start_ffmpeg(file, pixel_format).communicate(timeout=30)[0]
    wanted = rendered(scene, folder)
    print(f"{pixel_format}: {summary['cameras'][0]['sinks']}")
    support.expect_frames(split(from_file, size), wanted, f"ffmpeg, {pixel_format}, file")
    support.expect_frames(split(from_fifo, size), wanted, f"ffmpeg, {pixel_format}, FIFO")
    if pixel_format != "GREY":
        return
    from_file = start_opencv(file).communicate(timeout=30)[0]
    support.expect_frames(split(from_file, size), wanted, "OpenCV, GREY, file")
    at_fifo = start_opencv(fifo)
    fly(scene, [fifo])
    support.expect_frames(split(at_fifo.communicate(timeout=30)[0], size), wanted, "OpenCV, GREY, FIFO")


for pixel_format in FFMPEG_RAW:
    check_format(pixel_format)
