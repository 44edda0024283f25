#!/usr/bin/python3
"""A camera operated in real time by the Python package over slcan: triggers at 10 Hz, each with a change of settings.
Every trigger exposes one frame at the time and with the settings stated in the camera's replies.

Usage: operate.py [SECONDS]   (default 6)"""
import random
import sys
import time

import support
from support import expect

try:
    import can, serial  # noqa: F401: narpa.can needs them for slcan
except ImportError as error:
    support.skip(f"{error} (python3-can, python3-serial)")
from narpa.can import Bus

TRIGGERS = round(10 * float(sys.argv[1])) if len(sys.argv) > 1 else 60
MS = 1_000_000


def receive_until(bus, name, counter, seconds=5):
    """The next message of this name and counter, and a list of the other messages before it."""
    others, until = [], time.monotonic() + seconds
    while time.monotonic() < until:
        message = bus.receive(0.2)
        if message and message.name == name and message.counter == counter:
            return message, others
        if message:
            others.append(message)
    expect(False, f"{name} {counter} arrives within {seconds} s")


folder = support.work_folder()
scene = support.scene_with(folder, "GREY")
text = scene.read_text()
text = text.replace('\nformat = "GREY"', '\nformat = "GREY"\ncontrol = {trigger = "command", exposure_min_s = 1e-4}', 1)
scene.write_text(text)
port = support.free_port()
random.seed(7)
with support.Run(scene, "--can", f"slcan:{port}", "--video", f"{support.CAMERA}=none") as run:
    run.wait_for("commands: ")
    bus = Bus(f"slcan:{port}", patience_s=30)
    promises, starts, states, ledgers = [], [], {}, {}  # promises: (time from which the settings apply, settings)

    def note(messages):
        for m in messages:
            if m.name == "CameraState":
                states[m["Frame"]] = m
            elif m.name == "Ledger":
                ledgers[m["Frame"]] = m

    begin = time.monotonic()
    for k in range(TRIGGERS):
        time.sleep(max(0.0, begin + 0.1 * k - time.monotonic()))
        settings = {"Exposure": random.randrange(1, 20) * MS, "Gain": random.randrange(0, 240) / 10, "Binning": random.randrange(1, 4)}
        bus.send("CameraCommand", Camera=0, **settings)
        reply, others = receive_until(bus, "CameraReply", k % 256)
        note(others)
        if reply["Answer"] != "accepted":
            expect(False, f"command {k}: {reply['Answer']}")
        # Settings may apply before time 0 of the clock. Such times are negative modulo 2^48.
        promises.append(((reply["Time"] + (1 << 47)) % (1 << 48) - (1 << 47), settings))
        bus.send("CameraTrigger", Cameras=1, AtOnce=1, Time=0)
        reply, others = receive_until(bus, "CameraReply", k % 256)
        note(others)
        if reply["Answer"] != "accepted":
            expect(False, f"trigger {k}: {reply['Answer']}")
        starts.append(reply["Time"])
    time.sleep(0.5)
    while message := bus.receive(0.2):
        if message.name == "Heartbeat" and len(states) == TRIGGERS:
            break
        note([message])
    summary = run.stop()
[camera] = summary["cameras"]
print("summary:", camera["control"], "frames", camera["frames"], "late", camera["deadlines_missed"])
expect(sorted(states) == list(range(min(states), min(states) + TRIGGERS)), f"{TRIGGERS} triggers, {len(states)} frames")
for t_ns, frame in zip(starts, sorted(states)):
    state, ledger = states[frame], ledgers[frame]
    settings = [s for t, s in promises if t <= t_ns][-1]
    middle = t_ns + settings["Exposure"] // 2
    got = {"Exposure": state["Exposure"], "Gain": round(state["Gain"], 3), "Binning": state["Binning"]}
    if ledger["ExposureMid"] != middle or got != settings:
        expect(False, f"frame {frame}: middle {ledger['ExposureMid']} with {got}, promised {middle} with {settings}")
expect(True, "every frame was exposed at the promised time with the promised settings")
expect(camera["control"]["triggers_dropped"] == 0 and camera["control"]["triggers_refused"] == 0, "no trigger was missed")
