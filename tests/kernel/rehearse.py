#!/usr/bin/python3
"""In the virtual machine: the last 0.3 m of a docking with kernel devices, in lockstep and with small frames. The bus is CAN FD on
vcan0; the navigation's only sensor is a USB camera, driven by the kernel's uvcvideo. The chaser docks and passes every gate.
On vcan0+vcan1, two redundant buses, vcan0 goes down for good on the way.

Usage: rehearse.py [BUS]   (outside the rig: rehearse.py slcan:0, with a FIFO in the camera's place)"""
import json
import os
import re
import socket
import struct
import subprocess
import sys
import threading
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "host"))
import can_devices
import small_docking
import support
import usb_devices
from support import expect

NAVIGATION = Path(support.NARPA).with_name("narpa-navigation")
os.environ["NARPA_PLOT"] = "true"  # no charts: an emulated processor takes minutes for matplotlib
BUS = sys.argv[1] if sys.argv[1:] else "vcan0"
REDUNDANT = BUS == "vcan0+vcan1"
CAMERA_PORT = 3241
CUT_AFTER_ESTIMATES, NAVIGATION_ID = 4, 0x73F  # of CAN FD


def cut_on_the_way():
    """Cuts vcan0 after some estimates, each of which is one frame."""
    bus = socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
    bus.setsockopt(socket.SOL_CAN_RAW, socket.CAN_RAW_FD_FRAMES, 1)
    bus.setsockopt(socket.SOL_CAN_RAW, socket.CAN_RAW_FILTER, struct.pack("=II", NAVIGATION_ID, socket.CAN_SFF_MASK))
    bus.bind(("vcan0",))

    def run():
        for _ in range(CUT_AFTER_ESTIMATES):
            bus.recv(72)
        can_devices.cut("vcan0")
        print("vcan0 is cut", flush=True)

    thread = threading.Thread(target=run, daemon=True)
    thread.start()
    return thread


def start_navigation(log):
    """Attaches the emulated camera and starts the navigation when `narpa rehearse` asks for it. The navigation streams before
    the first frame is rendered."""
    wait_until = usb_devices.wait_until
    wait_until("narpa rehearse asks for the navigation", lambda: "LOG=" in log.read_text(), 240)
    told = dict(re.findall(r"^  (\w+)=(.*)$", log.read_text(), flags=re.M))
    usb_devices.attach(CAMERA_PORT)
    wait_until("uvcvideo has the camera", usb_devices.usb_camera)
    buses = [word for bus in told["BUS"].split("+") for word in ("--can", bus)]
    command = [NAVIGATION, told["SCENARIO"], *buses, "--video", f"nav={usb_devices.usb_camera()}", "--lockstep",
               "--seed", told["SEED"], "--threads", "2", "--log", folder / "navigation"]  # fmt: skip
    with open(folder / "navigation.out", "w") as out, open(folder / "navigation.err", "w") as err:
        navigation = subprocess.Popen([str(c) for c in command], stdout=out, stderr=err)
    wait_until("the navigation is ready", lambda: navigation.poll() is not None or "ready" in (folder / "navigation.out").read_text(), 240)
    return navigation


folder = support.work_folder()
command = [support.NARPA, "rehearse", small_docking.write(folder), "-o", folder / "out", "--threads", "2", "--patience", "300", "--json"]
command += [word for bus in BUS.split("+") for word in ("--can", bus)]
on_usb = BUS.startswith("vcan0")
if REDUNDANT:
    can_devices.add_bus("vcan1")
    cut = cut_on_the_way()
if on_usb:
    command += ["--video", f"nav=uvc:{CAMERA_PORT}", "--navigation", "none"]
log = folder / "rehearse.err"
rehearsal = subprocess.Popen([str(c) for c in command], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=open(log, "w"), text=True)
navigation = start_navigation(log) if on_usb else None
out, _ = rehearsal.communicate("\n" if on_usb else None)  # Enter confirms that the navigation is listening
if rehearsal.returncode != 0:
    print(out)
    for log in sorted(folder.rglob("*.log")) + sorted(folder.rglob("*.err")):
        print(f"--- {log}\n{log.read_text(errors='replace')[-2000:]}")
expect(rehearsal.returncode == 0, f"narpa rehearse on {BUS} exits with 0 (it did with {rehearsal.returncode})")
verdict = json.loads(out)
contact = {c["name"]: f"{c['value']:.4f} {c['unit']}" for c in verdict["contact"]["conditions"]}
expect(verdict["contact"]["captured"], f"captured: {contact}")
expect(verdict["bus"]["refused"] == 0, f"nothing on the bus was refused: {verdict['bus']}")
if on_usb:
    expect(navigation.wait(60) == 0, "the navigation ends well")
    n = json.loads((folder / "navigation/navigation.json").read_text())
    taken = n["sensors"]["nav"]["taken"]
    expect(n["frames_missing"] == 0 and n["frames"] == n["cycles"] == taken > 5, f"each of {n['cycles']} cycles had its frame, by USB alone")
if REDUNDANT:
    cut.join(0)
    expect(not cut.is_alive(), f"vcan0 was cut after {CUT_AFTER_ESTIMATES} of {n['cycles']} estimates")
    report = (folder / "out/emulator.log").read_text()
    uses = re.findall(r"(vcan\d) .*: (\d+) frames used, (\d+) as duplicates or not in use, (\d+) sent", report)
    expect([name for name, *_ in uses] == ["vcan0", "vcan1"], f"the report has both buses: {uses}")
    (used_a, twice_a, sent_a), (used_b, twice_b, sent_b) = (map(int, use[1:]) for use in uses)
    expect(used_b > 0 and sent_b > sent_a > 0, "B was used, and has sent more than A")
    faults = re.findall(r"frames used, .* sent; faults: (.*)", report)
    expect(re.fullmatch(r"[1-9]\d* not sent, 1 connection or interface lost", faults[0]) and faults[1] == "none", f"A was lost: {faults}")
    expect(used_a + twice_a < used_b + twice_b, "of A fewer frames came: it was down")
    expect(twice_a + twice_b > 50, "frames of both were counted as duplicates before the cut")
