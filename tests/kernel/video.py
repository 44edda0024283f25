#!/usr/bin/python3
"""In the virtual machine: poses on vcan0, frames on /dev/video10, read by v4l2-ctl, ffmpeg, GStreamer and OpenCV in turn. In every
pixel format each receives frames byte-identical to `narpa render`. If Y4M supports the format, the reference is a Y4M file of the
same run, of which one frame is compared with `narpa render` (tests/host/readers.py compares all). A reader that is killed does not
stop the stream."""
import subprocess
import sys
import threading
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "host"))
import support
from support import expect

import cv2  # imported once: it takes ten seconds on an emulated processor

DEVICE = "/dev/video10"
FRAMES_PER_READER = 3
# A frame is written shortly after its ledger is sent, and a reader needs time on an emulated processor.
PACE_S = 0.15
POSES = support.flight(60)
IN_Y4M = {"GREY", "Y16", "YUYV"}

# The readers are not told the pixel format.
COMMANDS = {
    "v4l2-ctl": f"v4l2-ctl -d {DEVICE} --stream-mmap --stream-count={FRAMES_PER_READER} --stream-to=OUT",
    "ffmpeg": f"ffmpeg -v error -nostdin -f v4l2 -i {DEVICE} -frames:v {FRAMES_PER_READER} -c:v copy -f rawvideo OUT",
    "GStreamer": f"gst-launch-1.0 -q v4l2src device={DEVICE} num-buffers={FRAMES_PER_READER} ! filesink location=OUT",
}


def start(command, out):
    """Starts a reader and waits until it has mapped the device's buffers, just before it begins to stream."""
    words = [word.replace("OUT", str(out)) for word in command.split()]
    process = subprocess.Popen(words, stdout=subprocess.DEVNULL)
    until = time.monotonic() + 90
    while DEVICE not in Path(f"/proc/{process.pid}/maps").read_text():
        expect_running(process)
        if time.monotonic() > until:
            expect(False, f"{words[0]} begins to read {DEVICE}")
        time.sleep(0.1)
    time.sleep(0.3)
    return process


def expect_running(process):
    if process.poll() is not None:
        expect(False, f"{process.args[0]} reads {DEVICE} (it ended with {process.returncode})")


class Flight:
    """Commands POSES[frame] frame by frame, alternately in classic frames and CAN FD."""

    def __init__(self, run, wire):
        run.wait_for("vcan0")
        self.bus = support.open_bus(run, interface="socketcan", channel="vcan0", fd=True)
        self.wire, self.sent = wire, 0

    def next(self):
        frame = self.sent
        for message in self.wire.command(POSES[frame], frame * support.PERIOD_NS, frame, fd=frame % 2 == 1):
            self.bus.send(message)
        support.await_ledger(self.bus, self.wire, frame)
        self.sent += 1
        time.sleep(PACE_S)

    def until(self, ended, what):
        """Sends as many frames as a reader expects, and one more for each that it missed. `ended(timeout_s)` waits for the reader."""
        for _ in range(FRAMES_PER_READER):
            self.next()
        while not ended(3):
            if self.sent == len(POSES):
                expect(False, f"{what} has {FRAMES_PER_READER} frames after {self.sent} were sent")
            self.next()


def read_by_command(tool, flight, out):
    process = start(COMMANDS[tool], out)

    def ended(timeout_s):
        try:
            return process.wait(timeout_s) is not None
        except subprocess.TimeoutExpired:
            return False

    flight.until(ended, tool)
    expect(process.returncode == 0, f"{tool} ends well")


def read_by_opencv(flight, out):
    video = cv2.VideoCapture(DEVICE, cv2.CAP_V4L2)
    video.set(cv2.CAP_PROP_CONVERT_RGB, 0)
    frames = []

    def read():
        for _ in range(FRAMES_PER_READER):
            good, picture = video.read()
            frames.append(picture.tobytes() if good else b"")

    reader = threading.Thread(target=read, daemon=True)
    reader.start()

    def ended(timeout_s):
        reader.join(timeout_s)
        return not reader.is_alive()

    flight.until(ended, "OpenCV")
    video.release()
    out.write_bytes(b"".join(frames))


def kill_a_reader(flight, folder):
    doomed = start("v4l2-ctl -d /dev/video10 --stream-mmap --stream-to=OUT", folder / "doomed")
    flight.next()
    expect_running(doomed)
    doomed.kill()
    doomed.wait()
    flight.next()
    expect(True, "v4l2-ctl was killed while it read")


def reference_frames(scene, pixel_format, video, sent, folder):
    """All frames of a run in the device's layout: from the Y4M file of the run, with Y, U and V interleaved again, or rendered if
    Y4M does not support the format."""
    if not video:
        return [support.render(scene, frame, POSES[frame], folder) for frame in range(sent)]
    frames, last = support.read_y4m(video), sent - 1
    if pixel_format == "YUYV":
        n = support.WIDTH * support.HEIGHT
        frames = [interleaved(f[:n:2], f[n : n * 3 // 2], f[1:n:2], f[n * 3 // 2 :]) for f in frames]
    expect(frames[last] == support.render(scene, last, POSES[last], folder), f"{pixel_format}: frame {last} is narpa render's")
    return frames


def interleaved(*planes):
    out = bytearray(sum(map(len, planes)))
    for i, plane in enumerate(planes):
        out[i :: len(planes)] = plane
    return bytes(out)


def expect_from(reference, path, first, sent, what):
    """Each frame in the file is one of first..sent-1, byte for byte, and later than the one before it."""
    data, size = path.read_bytes(), len(reference[first])
    numbers = []
    for at in range(0, len(data), size):
        got, begin = data[at : at + size], numbers[-1] + 1 if numbers else first
        number = next((k for k in range(begin, sent) if reference[k] == got), None)
        if number is None:
            expect(False, f"{what}: frame {len(numbers)} ({len(got)} bytes) is one of {begin}..{sent - 1}")
        numbers.append(number)
    expect(len(numbers) == FRAMES_PER_READER, f"{what}: frames {numbers} byte-identical")


def check_format(pixel_format, wire):
    folder = support.work_folder()
    scene = support.scene_with(folder, pixel_format)
    readings = []  # name of the reader, first frame that it can have received, one past the last
    video = folder / "nav.y4m" if pixel_format in IN_Y4M else None
    sinks = [word for sink in (DEVICE, video) if sink for word in ("--video", f"{support.CAMERA}={sink}")]
    with support.Run(scene, "--can", "vcan0", *sinks, "--lockstep") as run:
        flight = Flight(run, wire)
        flight.next()  # the device becomes a capture device with the first frame

        def reading(name, read, *arguments):
            first = flight.sent - 1  # the first frame a reader receives is the last one before it was started
            read(*arguments, flight, folder / name)
            readings.append((name, first, flight.sent))

        for tool in COMMANDS:
            reading(tool, read_by_command, tool)
        reading("OpenCV", read_by_opencv)
        if pixel_format == "GREY":
            kill_a_reader(flight, folder)
            reading("v4l2-ctl after another was killed", read_by_command, "v4l2-ctl")
        summary = run.stop()
    for sink in summary["cameras"][0]["sinks"]:
        expect(sink["written"] == flight.sent, f"{pixel_format}: {flight.sent} frames written: {sink}")
    reference = reference_frames(scene, pixel_format, video, flight.sent, folder)
    expect(len(reference) == len(set(reference)) == flight.sent, f"{pixel_format}: all {flight.sent} frames differ")
    for name, first, end in readings:
        expect_from(reference, folder / name, first, end, f"{pixel_format}, {name}")


wire = support.Wire()
for pixel_format in support.PIXEL_BYTES:
    check_format(pixel_format, wire)
