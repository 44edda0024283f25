#!/usr/bin/python3
"""In the virtual machine: narpa run with USB devices only. Poses arrive through the adapter narpa-usbcan, driven by narpa's own
driver (libusb). Frames leave through a USB camera, driven by the kernel's uvcvideo. v4l2-ctl and ffmpeg receive every frame,
byte-identical to `narpa render`. Adapter and camera are detached and attached again; exposure and gain are set with v4l2-ctl.

Usage: usb_run.py NARPA_USBCAN [all]     (all: also YUYV, and OpenCV and GStreamer: minutes more)"""
import json
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "host"))
import support
from support import expect
from usb_devices import attach, detach, ports_used, usb_camera, wait_until

ADAPTER_PORT, CAMERA_PORT = 3240, 3241
FRAMES = 3
POSES = support.flight(60)
READERS = {
    "v4l2-ctl": "v4l2-ctl -d DEVICE --stream-mmap --stream-count={n} --stream-to=OUT --verbose",
    "ffmpeg": "ffmpeg -v error -nostdin -f v4l2 -i DEVICE -frames:v {n} -c:v copy -f rawvideo OUT",
    "GStreamer": "gst-launch-1.0 -q v4l2src device=DEVICE num-buffers={n} ! filesink location=OUT",
}
OPENCV = """
import cv2, sys
video = cv2.VideoCapture(sys.argv[1], cv2.CAP_V4L2)
video.set(cv2.CAP_PROP_CONVERT_RGB, 0)
with open(sys.argv[2], "wb") as out:
    for _ in range(int(sys.argv[3])):
        good, picture = video.read()
        out.write(picture.tobytes() if good else b"")
"""


class Flight:
    def __init__(self, wire):
        import can

        self.bus = can.Bus(interface="socketcan", channel="vcan0", fd=True)
        self.wire, self.sent = wire, 0

    def next(self):
        """Commands the pose of the next frame, alternately classic and CAN FD, and waits until narpa has rendered the frame."""
        for message in self.wire.command(POSES[self.sent], self.sent * support.PERIOD_NS, self.sent, fd=self.sent % 2 == 1):
            self.bus.send(message)
        ledger = support.await_ledger(self.bus, self.wire, self.sent, 60)
        self.sent += 1
        return ledger


def read(tool, device, flight, out, frames=FRAMES):
    if tool == "OpenCV":
        command = [sys.executable, "-c", OPENCV, device, str(out), str(frames)]
    else:
        command = [w.replace("OUT", str(out)).replace("DEVICE", device) for w in READERS[tool].format(n=frames).split()]
    log = open(f"{out}.log", "w")
    reader = subprocess.Popen(command, stdout=log, stderr=log)

    def begins():
        if reader.poll() is not None:
            expect(False, f"{tool} reads {device}: {Path(f'{out}.log').read_text()[-500:]}")
        if tool == "GStreamer":  # maps its buffers only when it has received a frame
            return any(str(fd.resolve()) == device for fd in Path(f"/proc/{reader.pid}/fd").iterdir())
        return device in Path(f"/proc/{reader.pid}/maps").read_text()

    wait_until(f"{tool} begins to read {device}", begins, 240)
    time.sleep(1)  # it has started the stream
    while reader.poll() is None:
        expect_poses_left(flight)
        flight.next()
        try:
            reader.wait(1 if tool == "GStreamer" else 0.2)
        except subprocess.TimeoutExpired:
            pass
    expect(reader.returncode == 0, f"{tool} ends well")
    return Path(f"{out}.log").read_text()


def expect_poses_left(flight):
    if flight.sent == len(POSES):
        expect(False, "the reader has its frames in time")


def check_frames(scene, folder, path, first, flight, what, pulled=False):
    """The file has consecutive frames of first..sent-1, byte-identical: once the stream runs, no frame is lost or repeated. With
    `pulled` there may be more than FRAMES, and an incomplete last frame."""
    data = path.read_bytes()
    rendered = {}

    def render(k):
        if k not in rendered:
            rendered[k] = support.render(scene, k, POSES[k], folder)
        return rendered[k]

    size = len(render(first))
    got = [data[at : at + size] for at in range(0, len(data) - (size - 1 if pulled else 0), size)]
    start = next((k for k in range(first, flight.sent) if render(k) == got[0]), None)
    if start is None:
        expect(False, f"{what}: the first of {len(got)} frames ({len(got[0])} bytes) is one of {first}..{flight.sent - 1} as rendered")
    same = [k for k in range(len(got)) if start + k < flight.sent and render(start + k) == got[k]]
    expect(len(same) == len(got) and (len(got) == FRAMES or pulled and len(got) > FRAMES), f"{what}: frames {start}..{start + len(got) - 1}, all, byte-identical to narpa render")


def controlled(scene):
    text = scene.read_text()
    text = re.sub(r'^(format = "\w+")', r"\1\ncontrol = { exposure_min_s = 1e-4 }", text, count=1, flags=re.M)
    scene.write_text(text)
    return scene


def set_controls(device, flight):
    """The settings apply from the time stated in the camera's reply on CAN, and in no frame before."""
    subprocess.run(["v4l2-ctl", "-d", device, "-c", "exposure_time_absolute=30,gain=600"], check=True)
    promises, states, until = [], {}, time.monotonic() + 60
    for _ in range(4):
        for message in flight.wire.command(POSES[flight.sent], flight.sent * support.PERIOD_NS, flight.sent):
            flight.bus.send(message)
        frame, flight.sent = flight.sent, flight.sent + 1
        while frame not in states and time.monotonic() < until:
            message = flight.bus.recv(0.2)
            received = message and flight.wire.accept(message)
            if received and received.name == "CameraReply":
                expect(received["Answer"] == "accepted", f"the camera accepts: {received['Answer']}")
                promises.append(received["Time"])
            elif received and received.name == "CameraState":
                states[received["Frame"]] = (received["Exposure"], received["Gain"])
    expect(len(promises) == 2, f"two settings are answered on CAN, for {promises} ns")
    expect(len(states) >= 4, f"the frames tell their settings: {states}")
    for frame, (exposure_ns, gain) in sorted(states.items()):
        mid_ns = frame * support.PERIOD_NS
        acts = mid_ns - 1_500_000 >= max(promises)
        wanted = (3_000_000, 6.0) if acts else (150_000, 0.0)
        expect((exposure_ns, gain) == wanted, f"frame {frame}: exposure {exposure_ns} ns, gain {gain} dB, {'after' if acts else 'before'} the promised time")
    expect(any(e == 3_000_000 for e, _ in states.values()), "the settings act")


def read_until_pulled(device, port, flight, out, frame_bytes):
    """The camera is detached while v4l2-ctl streams and has received FRAMES frames. The run continues without it."""
    command = READERS["v4l2-ctl"].replace("OUT", str(out)).replace("DEVICE", device).format(n=10000).split()
    with open(f"{out}.log", "w") as log:
        reader = subprocess.Popen(command, stdout=log, stderr=log)
    wait_until("v4l2-ctl begins", lambda: reader.poll() is None and device in Path(f"/proc/{reader.pid}/maps").read_text(), 240)
    time.sleep(1)  # it has started the stream
    while not out.exists() or out.stat().st_size < FRAMES * frame_bytes:
        expect_poses_left(flight)
        flight.next()
        time.sleep(0.2)
    detach(port)
    for _ in range(2):
        flight.next()
    expect(reader.wait(60) is not None, "the camera was pulled out of a stream: its reader ends, the run goes on")


def session(pixel_format, readers, wire, pulls=False, controls=False):
    folder = support.work_folder()
    scene = support.scene_with(folder, pixel_format)
    if controls:
        controlled(scene)
    with support.Run(scene, "--can", "usb:NARPA0001", "--video", f"{support.CAMERA}=uvc:{CAMERA_PORT}", "--lockstep") as run:
        run.wait_for("USB camera at")
        before = set(ports_used())
        attach(CAMERA_PORT)
        wait_until("uvcvideo has the camera", usb_camera)
        device = usb_camera()
        [camera_port] = set(ports_used()) - before
        flight = Flight(wire)
        flight.next()
        if controls:
            set_controls(device, flight)
        checks = []
        if pulls:
            first = flight.sent
            read_until_pulled(device, camera_port, flight, folder / "pulled", len(support.render(scene, 0, POSES[0], folder)))
            checks.append(("pulled", first))
            attach(CAMERA_PORT)
            wait_until("uvcvideo has the camera again", usb_camera)
            device = usb_camera()
            [camera_port] = set(ports_used()) - before
        for tool in readers:
            first = flight.sent
            log = read(tool, device, flight, folder / tool)
            checks.append((tool, first))
            if tool == "v4l2-ctl":
                numbers = [int(n) for n in re.findall(r"seq:\s*(\d+)", log)][:FRAMES]
                expect(numbers == list(range(FRAMES)), f"the kernel numbers them {numbers}")
        if pulls:
            [adapter_port] = before
            detach(adapter_port)
            time.sleep(1)
            run.expect_alive()
            attach(ADAPTER_PORT)
            wait_until("the kernel sees the adapter again, or narpa has it", lambda: len(ports_used()) == 2)
            time.sleep(3)  # narpa looks for the adapter once a second
            for _ in range(3):
                flight.next()
            expect(True, "the adapter was pulled out and put back: the run goes on")
        summary = run.stop()
        detach(camera_port)
        flight.bus.shutdown()
    can, [sink] = summary["can"], summary["cameras"][0]["sinks"]
    print(f"{pixel_format}: can {can}\n{pixel_format}: sink {sink}")
    expect(can["commands_taken"] == flight.sent, f"{flight.sent} commands were sent over USB, {can['commands_taken']} taken")
    expect(can["interface_down"] == (1 if pulls else 0), "the summary counts how often the adapter went away")
    streams = len(checks)
    counted = sum(sink[n] for n in ("written", "dropped_failed", "dropped_no_reader", "dropped_ring_full"))
    expect(counted == flight.sent, f"each of {flight.sent} frames is in one of the sink's counts")
    expect(sink["reconnects"] == streams, f"the sink counts {streams} streams: {sink['reconnects']}")
    if not controls:
        for tool, first in checks:
            check_frames(scene, folder, folder / tool, first, flight, f"{pixel_format}, {tool}", pulled=tool == "pulled")


usbcan = subprocess.Popen([sys.argv[1], "--can", "vcan0", "--listen", str(ADAPTER_PORT)], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)
attach(ADAPTER_PORT)
wait_until("the adapter is seen", lambda: len(ports_used()) == 1)
wire = support.Wire()
everything = sys.argv[2:] == ["all"]
session("GREY", ["v4l2-ctl", "ffmpeg", "OpenCV"] if everything else ["ffmpeg"], wire, pulls=True)
session("GREY", [], wire, controls=True)
session("Y16", ["v4l2-ctl"], wire)
if everything:
    session("YUYV", ["v4l2-ctl", "GStreamer"], wire)
usbcan.send_signal(signal.SIGINT)
print("narpa-usbcan:", json.loads(usbcan.communicate(timeout=30)[0]))
