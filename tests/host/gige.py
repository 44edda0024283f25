#!/usr/bin/python3
"""Aravis's own client reads the sink gige: of a run in real time, in a network of its own: every frame, its number and its time, and
arv-camera-test finds nothing wrong."""
import os
import re
import shutil
import signal
import struct
import subprocess
import sys
import time

import numpy as np

import support
from support import expect

from narpa import pixels, y4m  # noqa: E402  (support sets the path)

WIDTH, HEIGHT, FRAMES = 640, 480, 30
NAME = "narpa-0001"

if len(sys.argv) < 2:
    support.enter_own_network(os.path.abspath(__file__), "inside")
subprocess.run(["ip", "link", "set", "lo", "up"], check=True)
probe = subprocess.run([support.NARPA, "check", support.SCENE, "--video", f"{support.CAMERA}=gige:"], capture_output=True, text=True)
if "built without Aravis" in probe.stdout + probe.stderr:
    support.skip("narpa was built without Aravis (NARPA_WITH_ARAVIS)")
try:
    import gi

    gi.require_version("Aravis", "0.8")
    from gi.repository import Aravis
except (ImportError, ValueError):
    support.skip("no Aravis for Python; try: apt-get install python3-gi gir1.2-aravis-0.8")


def scene_of(folder, pixel_format):
    scene = support.scene_with(folder, pixel_format)
    text = scene.read_text()
    for old, new in (("resolution = [160, 120]", f"resolution = [{WIDTH}, {HEIGHT}]\nembedded_line = true"),):
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    scene.write_text(text)
    return scene


def receive(camera, code, count):
    """Frame number, time and pixels of `count` frames."""
    stream, payload = camera.create_stream(None, None), camera.get_payload()
    for _ in range(20):
        stream.push_buffer(Aravis.Buffer.new_allocate(payload))
    camera.start_acquisition()
    found = []
    while len(found) < count:
        buffer = stream.timeout_pop_buffer(20_000_000)
        if buffer is None or buffer.get_status() != Aravis.BufferStatus.SUCCESS:
            expect(False, f"{code}: buffer {len(found)} is whole ({buffer and buffer.get_status()})")
        found.append((buffer.get_frame_id() - 1, buffer.get_timestamp(), bytes(buffer.get_data())))
        stream.push_buffer(buffer)
    camera.stop_acquisition()
    return found


def embedded(frame, row_bytes):
    """Number and time of mid-exposure that the embedded line names."""
    row = frame[-row_bytes:]
    expect(row[:6] == b"NRPA\x03\xa0", "the frame has its embedded line") if row[:6] != b"NRPA\x03\xa0" else None
    return struct.unpack_from("<I", row, 12)[0], struct.unpack_from("<q", row, 96)[0]


def check(pixel_format, code):
    folder = support.work_folder()
    scene, record = scene_of(folder, pixel_format), folder / "same.y4m"
    row_bytes = WIDTH * (1 if pixel_format == "GREY" else 2)
    videos = [f"{support.CAMERA}=gige:", f"{support.CAMERA}={record}"]
    with support.Run(scene, *(part for v in videos for part in ("--video", v))) as run:
        run.wait_for(re.escape(f"GigE Vision camera {NAME} at 127.0.0.1"))
        camera = Aravis.Camera.new(NAME)
        expect(camera.get_region()[2:] == (WIDTH, HEIGHT), "the client is told the size")
        expect(camera.get_pixel_format_as_string() == code, f"and the pixel format, {code}")
        first = receive(camera, code, FRAMES)
        again = receive(camera, code, 5)  # stops and starts
        del camera
        if shutil.which("arv-camera-test-0.8"):
            tester = subprocess.Popen(["arv-camera-test-0.8", "-n", NAME], stdout=subprocess.PIPE, text=True)
            time.sleep(5)
            tester.send_signal(signal.SIGINT)
            said = dict(re.findall(r"^(n_\w+) += (\d+)", tester.communicate(timeout=60)[0], re.M))
            print(said)
            wrong = {k: v for k, v in said.items() if v != "0" and k not in ("n_completed_buffers", "n_received_packets", "n_transferred_bytes")}
            expect(int(said["n_completed_buffers"]) > 10 and not wrong, f"arv-camera-test: {said['n_completed_buffers']} buffers, wrong: {wrong}")
        else:
            print("SKIP: no arv-camera-test-0.8; try: apt-get install aravis-tools-cli")
        print(run.stop()["cameras"][0]["sinks"])
    reader = y4m.Reader(record)
    recorded = {embedded(frame, row_bytes)[0]: frame for frame in iter(reader.read_bytes, None)}
    numbers = [number for number, _, _ in first]
    expect(numbers == list(range(numbers[0], numbers[0] + FRAMES)), f"{code}: every frame, from {numbers[0]} to {numbers[-1]}")
    expect(again[0][0] > numbers[-1], f"{code}: a client that comes again gets later frames, from {again[0][0]}")
    for number, t_ns, frame in first + again:
        if embedded(frame, row_bytes) != (number, t_ns):
            expect(False, f"{code}: frame {number} at {t_ns} ns says of itself {embedded(frame, row_bytes)}")
        if frame != recorded[number]:
            differing = np.count_nonzero(np.frombuffer(frame, np.uint8) != np.frombuffer(recorded[number], np.uint8))
            expect(False, f"{code}: frame {number} differs in {differing} bytes")
    expect(True, f"{code}: {len(first + again)} frames as FILE.y4m has them, with their numbers and times")


def check_packed(code, bits):
    """Frames of a test pattern, which the client unpacks."""
    folder = support.work_folder()
    scene = support.scene_with(folder, code)
    scene.write_text(scene.read_text().replace("resolution = [160, 120]", 'resolution = [160, 120]\ntest_pattern = "prbs"'))
    with support.Run(scene, "--video", f"{support.CAMERA}=gige:") as run:
        run.wait_for(re.escape(f"GigE Vision camera {NAME} at 127.0.0.1"))
        camera = Aravis.Camera.new(NAME)
        expect(camera.get_pixel_format_as_string() == code, f"the client is told the pixel format, {code}")
        frames = receive(camera, code, 10)
        run.stop()
    for number, _, frame in frames:
        expected = pixels.test_pattern("prbs", number, 160 * 120, bits).reshape(120, 160)
        if not np.array_equal(pixels.array(code, 160, 120, frame), expected):
            expect(False, f"{code}: frame {number} is what it is computed to be")
    expect(True, f"{code}: {len(frames)} frames of a pattern, unpacked")


check("GREY", "Mono8")
check_packed("Mono12p", 12)
check("Y16", "Mono16")
