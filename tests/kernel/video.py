#!/usr/bin/python3
"""In the rig: poses on vcan0, frames on /dev/video10, read by v4l2-ctl, ffmpeg, OpenCV and GStreamer at the same time;
what each of them gets is byte-identical to `narpa render`, in every pixel format. Then a reader is killed, and the next
one finds the stream going on."""
import subprocess
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "host"))
import support
from support import expect

DEVICE = "/dev/video10"
FRAMES_PER_READER = 3
# A frame is written a little after its ledger is told, and a reader has its turn on an emulated processor.
PACE_S = 0.3
POSES = support.flight(20)

OPENCV_READER = f"""
import cv2, sys
video = cv2.VideoCapture(sys.argv[1], cv2.CAP_V4L2)
assert video.isOpened()
video.set(cv2.CAP_PROP_CONVERT_RGB, 0)
for _ in range({FRAMES_PER_READER}):
    good, picture = video.read()
    assert good
    sys.stdout.buffer.write(picture.tobytes())
"""


def start_reader(tool, out):
    """The tool, reading FRAMES_PER_READER frames into the file `out`, told nothing of their format."""
    command = {
        "v4l2-ctl": ["v4l2-ctl", "-d", DEVICE, "--stream-mmap", f"--stream-count={FRAMES_PER_READER}", f"--stream-to={out}"],
        "ffmpeg": ["ffmpeg", "-v", "error", "-nostdin", "-f", "v4l2", "-i", DEVICE, "-frames:v", str(FRAMES_PER_READER),
                   "-c:v", "copy", "-f", "rawvideo", str(out)],
        "GStreamer": ["gst-launch-1.0", "-q", "v4l2src", f"device={DEVICE}", f"num-buffers={FRAMES_PER_READER}", "!",
                      "filesink", f"location={out}"],
        "OpenCV": [sys.executable, "-c", OPENCV_READER, DEVICE],
    }[tool]  # fmt: skip
    with open(out if tool == "OpenCV" else "/dev/null", "wb") as stdout:
        return subprocess.Popen(command, stdout=stdout)


def wait_until_reading(readers, seconds=60):
    """A reader has mapped the device's buffers just before it starts to stream."""
    until = time.monotonic() + seconds
    for tool, process in readers.items():
        while DEVICE not in Path(f"/proc/{process.pid}/maps").read_text():
            expect_running(tool, process)
            if time.monotonic() > until:
                expect(False, f"{tool} starts to read {DEVICE} within {seconds} s")
            time.sleep(0.1)
    time.sleep(0.5)


def expect_running(tool, process):
    if process.poll() is not None:
        expect(False, f"{tool} reads {DEVICE} (it ended with {process.returncode})")


class Flight:
    """Commands POSES[frame] for frame after frame, in classic frames and CAN FD by turns."""

    def __init__(self, run, wire):
        run.wait_for("vcan0")
        self.bus = support.open_bus(run, interface="socketcan", channel="vcan0", fd=True)
        self.wire, self.frame = wire, 0

    def next(self):
        for message in self.wire.command(POSES[self.frame], self.frame * support.PERIOD_NS, self.frame, fd=self.frame % 2 == 1):
            self.bus.send(message)
        support.await_ledger(self.bus, self.wire, self.frame)
        self.frame += 1
        time.sleep(PACE_S)

    def until_ended(self, readers):
        while any(process.poll() is None for process in readers.values()):
            expect(self.frame < len(POSES), f"{', '.join(readers)} have their frames after {self.frame} were sent")
            self.next()


class Reference:
    """What `narpa render` says of each frame, rendered when it is first asked for."""

    def __init__(self, scene, folder):
        self.scene, self.folder, self.frames = scene, folder, {}

    def __getitem__(self, frame):
        if frame not in self.frames:
            self.frames[frame] = support.render(self.scene, frame, POSES[frame], self.folder)
        return self.frames[frame]


def expect_from(reference, path, sent, what):
    """Each frame in the file is one of the `sent` first ones, byte for byte, each later than the one before it."""
    data, size = path.read_bytes(), len(reference[0])
    numbers = []
    for at in range(0, len(data), size):
        got = data[at : at + size]
        # A reader begins with one of the last frames before it came: look forward from the one before.
        begin = numbers[-1] + 1 if numbers else 0
        numbers.append(next((k for k in range(begin, sent) if reference[k] == got), None))
        if numbers[-1] is None:
            expect(False, f"{what}: frame {len(numbers) - 1} ({len(got)} bytes) is one of {begin}..{sent - 1} as rendered")
    expect(len(numbers) == FRAMES_PER_READER, f"{what}: frames {numbers} byte-identical to narpa render")


def check_format(pixel_format, wire, restart):
    folder = support.work_folder()
    scene = support.scene_with(folder, pixel_format)
    reference = Reference(scene, folder)
    with support.Run(scene, "--can", "vcan0", "--video", f"{support.CAMERA}={DEVICE}", "--lockstep") as run:
        flight = Flight(run, wire)
        flight.next()  # the device is a camera once a frame has been written
        readers = {tool: start_reader(tool, folder / tool) for tool in ("v4l2-ctl", "ffmpeg", "OpenCV", "GStreamer")}
        wait_until_reading(readers)
        flight.until_ended(readers)
        if restart:
            kill_one_start_another(flight, folder)
        summary = run.stop()
    [sink] = summary["cameras"][0]["sinks"]
    expect(sink["written"] == flight.frame, f"{pixel_format}: {flight.frame} frames written to the device: {sink}")
    for tool, process in readers.items():
        expect(process.returncode == 0, f"{tool} ends well")
        expect_from(reference, folder / tool, flight.frame, f"{pixel_format}, {tool}")
    if restart:
        expect_from(reference, folder / "after", flight.frame, f"{pixel_format}, v4l2-ctl after another was killed")


def kill_one_start_another(flight, folder):
    doomed = subprocess.Popen(["v4l2-ctl", "-d", DEVICE, "--stream-mmap", f"--stream-to={folder}/doomed"])
    wait_until_reading({"v4l2-ctl": doomed})
    flight.next()
    expect_running("v4l2-ctl", doomed)
    doomed.kill()
    doomed.wait()
    flight.next()
    after = {"v4l2-ctl": start_reader("v4l2-ctl", folder / "after")}
    wait_until_reading(after)
    flight.until_ended(after)


wire = support.Wire()
for pixel_format in support.PIXEL_BYTES:
    check_format(pixel_format, wire, restart=pixel_format == "GREY")
