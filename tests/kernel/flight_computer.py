#!/usr/bin/python3
"""In the virtual machine: the flight computer in C of examples/ docks with its SocketCAN and V4L2 code, in lockstep and with small
frames. Once with CAN FD, once with classic frames on an interface that carries no others; frames come through v4l2loopback."""
import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "host"))
import can_devices
import small_docking
import support
from support import expect
from usb_devices import wait_until

from narpa.can import Catalogue
from narpa.logs import Run

EXAMPLE = Path(__file__).resolve().parents[2] / "examples/flight_computer"
DEVICE = "/dev/video10"
SETS = {"Navigation": 0x730, "Actuator": 0x720}
FRAMES = {name: len(Catalogue().at(name).classic) for name in SETS}  # of classic CAN
os.environ["NARPA_PLOT"] = "true"  # no charts: an emulated processor takes minutes for matplotlib
folder = support.work_folder()
scenario = small_docking.write(folder)


def build(run_folder):
    """Builds a copy of the example with the mission of this run."""
    copy = folder / "flight_computer"
    shutil.copytree(EXAMPLE, copy, ignore=shutil.ignore_patterns("bin"))
    written = subprocess.run([sys.executable, EXAMPLE / "mission_table.py", run_folder], capture_output=True, text=True)
    expect(written.returncode == 0, f"mission_table.py reads the folder of a run that begins {written.stderr}")
    (copy / "mission.c").write_text(written.stdout)
    flags = "CFLAGS=-O1 -g -Wall -Wextra -fsanitize=address,undefined -fno-sanitize-recover"
    done = subprocess.run(["make", "-C", copy, f"BUILD={folder / 'build'}", flags], capture_output=True, text=True)
    expect(done.returncode == 0, f"it builds {done.stderr}")


def fly(bus):
    """Returns the folder of the rehearsal, its verdict, and what the flight computer printed."""
    out, log, printed = folder / bus, folder / f"{bus}.err", folder / f"{bus}.out"
    command = [support.NARPA, "rehearse", scenario, "-o", out, "--can", bus, "--video", f"nav={DEVICE}", "--navigation", "none",
               "--threads", "2", "--patience", "300", "--json"]  # fmt: skip
    with open(log, "w") as err, open(printed, "w") as said:
        rehearsal = subprocess.Popen([str(c) for c in command], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=err, text=True)
        wait_until("narpa rehearse asks for the navigation", lambda: "LOG=" in log.read_text(), 240)
        if not (folder / "build").exists():
            build(out)
        program = [folder / "build/flight_computer", "--can", bus, "--video", DEVICE]
        flight = subprocess.Popen([str(c) for c in program], stdout=said, stderr=subprocess.STDOUT)
        wait_until("the flight computer is ready", lambda: flight.poll() is not None or "\nready\n" in printed.read_text(), 60)
        result, _ = rehearsal.communicate("\n")  # Enter confirms that the navigation is listening
        status = flight.wait(60)
    text = printed.read_text()
    print(text)
    if rehearsal.returncode != 0:
        print(log.read_text(), result, (out / "emulator.log").read_text())
    expect(rehearsal.returncode == 0, f"{bus}: all gates are passed")
    expect(status == 0, f"{bus}: the flight computer ends well")
    return out, json.loads(result), text


def frames_of(run_folder, name):
    """(frames of classic CAN, frames of CAN FD) of a set of signals in the log."""
    base, frames = SETS[name], [0, 0]
    for line in (run_folder / "emulator/can.log").read_text().splitlines():
        identifier, fd = re.match(r"\(\S+\) \S+ ([0-9A-F]+)#(#?)", line).groups()
        frames[bool(fd)] += base <= int(identifier, 16) < base + 16
    return tuple(frames)


def docks(bus, fd):
    out, verdict, printed = fly(bus)
    contact = {c["name"]: f"{c['value']:.4f} {c['unit']}" for c in verdict["contact"]["conditions"]}
    expect(verdict["contact"]["captured"], f"{bus}: captured: {contact}")
    expect(verdict["bus"]["refused"] == 0, f"{bus}: nothing was refused")
    summary = r"(\d+) cycles, (\d+) with lamps, (\d+) without a frame;.* (\d+) not, (\d+) bad, (\d+) incomplete"
    cycles, with_lamps, *missing = map(int, re.search(summary, printed).groups())
    expect(missing == [0, 0, 0, 0], f"{bus}: each of {cycles} cycles had its frame, and none of CAN was unsent, bad or missing")
    run = Run(out)
    ledger = run.ledger("nav")
    expect(cycles <= len(ledger) <= cycles + 1, f"{bus}: the emulator has delivered {len(ledger)} frames")
    sent = {name: [m for _, m in run.messages() if m.name == name] for name in SETS}
    counts = {"Navigation": cycles - len(re.findall(r"docked: \d+ lamps", printed)), "Actuator": cycles}
    expect({name: len(all) for name, all in sent.items()} == counts, f"{bus}: each message arrived: {counts}")
    n = verdict["navigation"]
    expect(n["with_frames"] == with_lamps > 6, f"{bus}: lamps were found in {with_lamps} frames")
    expect(n["share_within"] == 1 and n["nees"] < 9, f"{bus}: all estimates are within four standard deviations, NEES {n['nees']:.2f}")
    for name in SETS:
        classic, in_fd = frames_of(out, name)
        expected = (0, counts[name]) if fd else (counts[name] * FRAMES[name], 0)
        expect((classic, in_fd) == expected, f"{bus}: {name} was sent in {classic} classic frames, {in_fd} of CAN FD")
    return [(m.name, m.counter, m.values) for name in SETS for m in sent[name]]


def waits_for_an_interface():
    """One that is down counts as one that is not there."""
    can_devices.add_bus("vcan3")
    can_devices.cut("vcan3")
    printed = folder / "down.out"
    with open(printed, "w") as said:
        command = [folder / "build/flight_computer", "--can", "vcan3", "--video", DEVICE]
        flight = subprocess.Popen([str(c) for c in command], stdout=said, stderr=subprocess.STDOUT)
    wait_until("it says that the interface is down", lambda: "vcan3: the interface is down; tries again" in printed.read_text())
    can_devices.set_up("vcan3")
    wait_until("it is ready once the interface is up", lambda: "\nready\n" in printed.read_text())
    flight.terminate()
    expect(flight.wait(60) == 0, "an interface that is down at first is waited for")


with_fd = docks("vcan0", fd=True)
can_devices.add_bus("vcan2", mtu=16)
classic = docks("vcan2", fd=False)
expect(classic == with_fd, f"{len(classic)} messages, the same on both")
waits_for_an_interface()
