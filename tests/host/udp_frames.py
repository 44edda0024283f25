#!/usr/bin/python3
"""Frames in datagrams through a network that loses, delays and reorders them, to the receivers in C and in Python."""
import random
import re
import shutil
import socket
import subprocess
import threading
import time
from pathlib import Path

import numpy as np

import support
from support import expect

from narpa import datagrams, pixels  # noqa: E402  (support sets the path)

RECEIVER = Path(__file__).resolve().parents[2] / "examples/frame_receiver/receive.c"

POSES = support.flight(12)
LOST = 0.01  # of the datagrams: enough that some of a few small frames are hit
DELAY_S = 0.001


class Relay(threading.Thread):
    """Forwards datagrams to some ports, late, some never and some exchanged with the next."""

    def __init__(self, to):
        super().__init__(daemon=True)
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 8 << 20)
        self.socket.bind(("127.0.0.1", 0))
        self.socket.settimeout(0.5)
        self.port = self.socket.getsockname()[1]
        self.to, self.random = to, random.Random(4)
        self.sent, self.lost = {}, {}  # of each frame
        self.ends = False

    def run(self):
        held = None
        while not self.ends:
            try:
                data = self.socket.recv(65536)
            except socket.timeout:
                held = self.forward(held)
                continue
            header, _ = datagrams.decode(data)
            self.sent[header.frame] = self.sent.get(header.frame, 0) + 1
            if self.random.random() < LOST:
                self.lost[header.frame] = self.lost.get(header.frame, 0) + 1
                continue
            if held is None and self.random.random() < 0.1:
                held = data
                continue
            self.forward(data)
            held = self.forward(held)

    def forward(self, data):
        if data is not None:
            time.sleep(DELAY_S)
            for port in self.to:
                self.socket.sendto(data, ("127.0.0.1", port))


def fly(folder, scene, sink):
    """The frames of a run in lockstep, as `narpa render` has them."""
    can_port = support.free_port()
    with support.Run(scene, "--can", f"slcan:{can_port}", "--video", f"{support.CAMERA}={sink}", "--lockstep") as run:
        support.command_frames(run, can_port, POSES)
        print(run.stop()["cameras"][0]["sinks"])
    return [support.render(scene, frame, pose, folder) for frame, pose in enumerate(POSES)]


def pixels_of(rendered, pixel_format):
    """What a receiver makes of a frame: Y12P has the ADC's 12 bits, files have them left-justified."""
    if pixel_format == "GREY":
        return np.frombuffer(rendered, np.uint8).reshape(support.HEIGHT, support.WIDTH)
    return np.frombuffer(rendered, "<u2").reshape(support.HEIGHT, support.WIDTH) >> 4


def check(pixel_format, receiver_in_c, code=None, link=""):
    """`code`: V4L2's, where it is not the name; `link`: further keys of the camera."""
    folder = support.work_folder()
    scene = support.scene_with(folder, pixel_format)
    scene.write_text(scene.read_text().replace(f'format = "{pixel_format}"', f'format = "{pixel_format}"\n{link}'))
    ports, in_c, came = [support.free_port(), support.free_port()], None, []
    if receiver_in_c:
        in_c = subprocess.Popen([receiver_in_c, str(ports[0]), str(folder / "frame_%u")], stdout=subprocess.PIPE, text=True)
    in_python = threading.Thread(target=lambda: came.extend(datagrams.receive(ports[1], "127.0.0.1", timeout_s=60)), daemon=True)
    in_python.start()
    relay = Relay(ports if in_c else ports[1:])
    relay.start()
    time.sleep(0.5)  # the receivers listen
    wanted = [pixels_of(frame, pixel_format) for frame in fly(folder, scene, f"udp:127.0.0.1:{relay.port},mtu=600,mbit_s=50")]
    for _ in range(600):  # what is still on the way; an incomplete frame ends with the second after it
        if len(came) >= len(wanted) - 2:
            break
        time.sleep(0.1)
    time.sleep(2)
    relay.ends = True
    relay.join()

    expect(len(relay.sent) == len(wanted) and len(set(relay.sent.values())) == 1, f"each frame is sent whole: {relay.sent}")
    expect(sum(relay.lost.values()) > 0, "some datagrams are lost")
    expect(any(n not in relay.lost for n in range(len(wanted))), "some frames lose none")
    print(f"{pixel_format}: {len(wanted)} frames, {sum(relay.sent.values())} datagrams, lost of each frame: {relay.lost}")

    for frame in came:
        number = frame.header.frame
        expect(frame.lost == relay.lost.get(number, 0), f"Python: frame {number} has lost {frame.lost}")
        expect(frame.lost > 0 or np.array_equal(frame.pixels, wanted[number]), f"Python: frame {number} is as it was rendered")
    numbers = [frame.header.frame for frame in came]
    expect(numbers == sorted(set(numbers)) and len(numbers) >= len(wanted) - 2, f"Python: frames in order: {numbers}")
    if not in_c:
        return
    in_c.terminate()
    lines = in_c.communicate()[0].splitlines()
    told = {int(m[1]): int(m[2]) for m in (re.match(r"frame (\d+): .* (\d+) of \d+ datagrams lost", line) for line in lines)}
    expect(len(told) >= len(wanted) - 2, f"C: {len(told)} frames")
    for number, lost in told.items():
        # A datagram that was exchanged with the first one of the next frame came too late for this receiver.
        expect(0 <= lost - relay.lost.get(number, 0) <= 1, f"C: frame {number} has lost {lost}")
        data = (folder / f"frame_{number}").read_bytes()
        got = pixels.array(code or pixel_format, support.WIDTH, support.HEIGHT, data)
        expect(lost > 0 or np.array_equal(got, wanted[number]), f"C: frame {number} is as it was rendered")


compiler = shutil.which("cc") or shutil.which("gcc")
receiver = support.work_folder() / "receive"
if compiler:
    subprocess.run([compiler, "-std=gnu11", "-O2", "-Wall", "-Wextra", "-Werror", "-o", receiver, RECEIVER], check=True)
else:
    print("SKIP: no C compiler: the receiver in C is left out")
for name in ("GREY", "Y12P"):
    check(name, receiver if compiler else None)
check("Y12", receiver if compiler else None, "Y12\xa0", 'byte_order = "big"\nrow_bytes = 352')
