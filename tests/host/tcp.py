#!/usr/bin/python3
"""ffmpeg, OpenCV and GStreamer read the sink tcp: of a run, all at once, byte for byte."""
import importlib.util
import re
import shutil
import subprocess
import sys
import time
from pathlib import Path

import support
from support import expect

POSES = support.flight(4)

OPENCV_READER = """
import cv2, sys
video = cv2.VideoCapture(sys.argv[1], cv2.CAP_FFMPEG)
out = open(sys.argv[2], "wb")
while True:
    good, picture = video.read()
    if not good: break
    out.write(cv2.split(picture)[0].tobytes())
"""


def has_gstreamer():
    return shutil.which("gst-inspect-1.0") and subprocess.run(["gst-inspect-1.0", "--exists", "y4mdec"]).returncode == 0


def readers(pixel_format, port, folder):
    """Name and command of each reader of this format that this machine has; each writes narpa's raw frames to a file of its name."""
    url, found = f"tcp://127.0.0.1:{port}", {}
    if shutil.which("ffmpeg"):
        found["ffmpeg"] = ["ffmpeg", "-v", "error", "-nostdin", "-i", url, "-f", "rawvideo", "-fps_mode", "passthrough",
                           "-pix_fmt", {"GREY": "gray", "YUYV": "yuyv422"}[pixel_format], folder / "ffmpeg"]
    if importlib.util.find_spec("cv2") and pixel_format == "GREY":
        found["OpenCV"] = [sys.executable, "-c", OPENCV_READER, url, folder / "OpenCV"]
    if has_gstreamer() and pixel_format == "YUYV":  # y4mdec (1.22) knows no Cmono
        found["GStreamer"] = ["gst-launch-1.0", "-q", "tcpclientsrc", "host=127.0.0.1", f"port={port}", "!", "y4mdec", "!",
                              "videoconvert", "!", "video/x-raw,format=YUY2", "!", "filesink", f"location={folder / 'GStreamer'}"]
    return found


def connections(port):
    """Established connections to a port of the loopback."""
    rows = [line.split() for line in Path("/proc/net/tcp").read_text().splitlines()[1:]]
    return sum(row[1] == f"0100007F:{port:04X}" and row[3] == "01" for row in rows)


def check(pixel_format):
    """All readers at once, of a run in lockstep. Returns their names."""
    folder = support.work_folder()
    scene = support.scene_with(folder, pixel_format)
    port, can_port = support.free_port(), support.free_port()
    commands = readers(pixel_format, port, folder)
    with support.Run(scene, "--can", f"slcan:{can_port}", "--video", f"{support.CAMERA}=tcp:{port}", "--lockstep") as run:
        run.wait_for(re.escape(f"Y4M at tcp://127.0.0.1:{port}"))
        started = {name: subprocess.Popen(list(map(str, command))) for name, command in commands.items()}
        for _ in range(1200):
            if connections(port) == len(started):
                break
            time.sleep(0.05)
        expect(connections(port) == len(started), f"{', '.join(started)} connect")
        support.command_frames(run, can_port, POSES)
        print(run.stop()["cameras"][0]["sinks"])
    wanted = [support.render(scene, frame, pose, folder) for frame, pose in enumerate(POSES)]
    size = support.WIDTH * support.HEIGHT * support.PIXEL_BYTES[pixel_format]
    for name, reader in started.items():
        expect(reader.wait(timeout=120) == 0, f"{name} ends well")
        data = (folder / name).read_bytes()
        support.expect_frames([data[i : i + size] for i in range(0, len(data), size)], wanted, f"{name}, {pixel_format}, tcp")
    return set(started)


missing = {"ffmpeg", "OpenCV", "GStreamer"} - check("GREY") - check("YUYV")
for name in sorted(missing):
    print(f"SKIP: no {name}; try: apt-get install ffmpeg python3-opencv gstreamer1.0-tools gstreamer1.0-plugins-bad")
if len(missing) == 3:
    support.skip("no reader of Y4M over TCP")
