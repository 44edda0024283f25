#!/usr/bin/python3
"""The flight computer in C of examples/: built by its Makefile, its tables against narpa's, and flown.

Usage: flight_computer.py                 the test
       flight_computer.py late PROGRAM    (by a rehearsal) PROGRAM, which gets one frame when it no longer waits for it"""
import json
import os
import re
import shutil
import socket
import struct
import subprocess
import sys
import threading
import zlib
from pathlib import Path
from random import Random

import support
from support import expect

EXAMPLE = Path(__file__).resolve().parents[2] / "examples/flight_computer"
LATE_FRAME = 4
SCENARIO = Path(os.environ["NARPA_BUILD_DIR"]) / "scenes/rehearsal/dispersions.toml"
folder = support.work_folder()
program = folder / "build/flight_computer"


def build():
    compiler = shutil.which("cc") or support.skip("no C compiler")
    if not shutil.which("make"):
        support.skip("no make")
    flags = "CFLAGS=-O2 -g -Wall -Wextra -Wconversion -Wno-sign-conversion -Werror -fsanitize=address,undefined -fno-sanitize-recover"
    done = subprocess.run(["make", "-C", EXAMPLE, f"BUILD={folder / 'build'}", f"CC={compiler}", flags], capture_output=True, text=True)
    expect(done.returncode == 0, f"it builds without a warning {done.stderr}")


def messages_are_those_of_the_dbc():
    from narpa.can import Catalogue

    lines = subprocess.run([program, "--messages"], capture_output=True, text=True, check=True).stdout.splitlines()
    row = re.compile(r"(\w+) 0x(\w+) frames (\d+) fd_counter (\d+): (\w+) frame (\d+) bit (\d+) fd_bit (\d+) bits (\d+) (\w+) step (\S+)$")
    catalogue, checked, wrong = Catalogue(), 0, []
    for line in lines:
        name, base, frames, fd_counter, signal, frame, bit, fd_bit, bits, sign, step = row.match(line).groups()
        if name == "Housekeeping":  # its own
            expect(catalogue.of(int(base, 16)) == (None, None), f"no message of narpa's has the identifier 0x{base} of {signal}")
            continue
        known = catalogue.at(name)
        classic = known.classic[int(frame)].signals[signal]
        expected = [known.base, len(known.classic), classic.start, classic.length, classic.signed, classic.factor]
        got = [int(base, 16), int(frames), int(bit), int(bits), sign == "signed", float(step)]
        if known.fd:
            expected += [known.fd.signals["Counter"].start, known.fd.signals[signal].start]
            got += [int(fd_counter), int(fd_bit)]
        wrong += [line] if got != expected else []
        checked += 1
    expect(not wrong, f"{checked} signals are as in the DBC, others: {wrong}")
    whole = sum(len(catalogue.at(n).fd.signals) - 2 for n in ("Attitude", "Dynamics", "Actuator", "Navigation"))
    expect(checked == whole + 3 + 2, "all signals of these sets are there, three of the ledger, two of the heartbeat")


def sets_are_those_of_python(fd):
    """Random sets, encoded by the Python package, are decoded and encoded again to the same bytes; damaged ones are dropped."""
    from narpa.can import Catalogue

    harness, random, catalogue = folder / "build/messages", Random(5), Catalogue()
    sources = [Path(__file__).with_name("flight_computer_messages.c"), EXAMPLE / "messages.c", EXAMPLE / "checksums.c"]
    subprocess.run(["cc", "-std=c11", "-D_DEFAULT_SOURCE", "-Wall", "-Wextra", "-Werror", f"-I{EXAMPLE}", "-o", harness, *sources, "-lm"], check=True)
    for name in ("Attitude", "Dynamics", "Actuator", "Navigation"):
        known = catalogue.at(name)
        signals = {k: s for k, s in known.fd.signals.items() if k not in ("Counter", "Crc")}
        for counter in range(20):
            raw = {k: random.randrange(-(2 ** (s.length - 1)) + 1 if s.signed else 0, 2 ** (s.length - s.signed)) for k, s in signals.items()}
            values = {k: r * signals[k].factor for k, r in raw.items()}
            frames = known.encode(values, counter, fd)
            text = [f"{identifier:X} {data.hex().upper()}" for identifier, data in frames]
            damaged = [line[:-1] + ("0" if line[-1] != "0" else "1") for line in text]
            arguments = [harness, "fd" if fd else "classic", str(counter)]
            lines = subprocess.run(arguments, input="\n".join(damaged + text), capture_output=True, text=True, check=True).stdout.splitlines()
            got = [float(v) for v in lines[0].split()[2:][:len(values)]] if lines else None
            if lines[1:] != text or got != list(values.values()):
                expect(False, f"{name}, counter {counter}: {values} gives {got}, {text} gives {lines[1:]}")
    expect(True, f"sets of 20 random values each, as {'CAN FD' if fd else 'classic'} frames: the same values and bytes as in Python")


def rehearse(name, *options):
    """Returns exit status, verdict and what the program printed."""
    out = folder / name
    navigation = [] if "--navigation" in options else ["--navigation", program]
    done = subprocess.run([support.NARPA, "rehearse", SCENARIO, "-o", out, "--json", *navigation, *options],
                          capture_output=True, text=True, timeout=1800)
    if done.returncode not in (0, 1):
        print(done.stderr)
    expect(done.returncode in (0, 1), f"the rehearsal {name} runs to its end")
    printed = (out / "navigation.log").read_text()
    found = "Sanitizer" in printed or "runtime error" in printed
    expect(not found, f"the sanitizers find nothing {printed if found else ''}")
    return done.returncode, json.loads(done.stdout), printed


def docks():
    status, verdict, printed = rehearse("docked")
    failed = {g["name"]: g["reason"] for g in verdict["gates"] if g["state"] == "failed"}
    if status != 0:
        print(printed)
    expect(status == 0, f"it docks with all gates passed: {verdict['headline']} {failed or ''}")
    n = verdict["navigation"]
    expect(n["with_frames"] > 0.9 * n["estimates"], f"lamps were found: in {n['with_frames']} of {n['estimates']} frames")
    expect(n["nees"] < 9, f"covariances hold: NEES {n['nees']}")
    modes = re.findall(r" -> (\w[\w ]*):", printed)
    expect(modes == ["wait for the target", "acquire", "approach", "closing", "docked"], f"mode by mode: {modes}")


def mission_is_that_of_the_scenario():
    """The table is written from a rehearsal's folder: here from the one just flown."""
    written = subprocess.run([sys.executable, EXAMPLE / "mission_table.py", folder / "docked"], capture_output=True, text=True)
    expect(written.returncode == 0, f"mission_table.py reads the folder {written.stderr}")
    expect(written.stdout == (EXAMPLE / "mission.c").read_text(), "mission.c is the table of scene and scenario as they are")


def repeats_in_lockstep():
    from narpa.logs import Run

    sent = []
    for name, video in [("once", []), ("again", []), ("datagrams", ["--video", f"nav=udp:127.0.0.1:{support.free_port()}"])]:
        rehearse(name, "--set", "scenario.duration_s=8.0", *video)
        sent.append([(m.name, m.counter, m.values) for _, m in Run(folder / name).messages() if m.name in ("Actuator", "Navigation")])
    expect(len(sent[0]) >= 16 and sent[1] == sent[0], f"in lockstep it sends the same again: {len(sent[0])} messages")
    expect(sent[2] == sent[0], "and the same when frames come in datagrams")


def late(program):
    """The program with a FIFO of its own, in which a frame is held back until the program says that it has not come."""
    name, fifo = os.environ["VIDEO"].split("=")
    gave_up, own = threading.Event(), fifo + ".late"
    os.mkfifo(own)

    def relay():
        with open(fifo, "rb") as source, open(own, "wb") as sink:
            header = source.readline()
            sink.write(header), sink.flush()
            width, height = (int(re.search(rb" %c(\d+)" % axis, header)[1]) for axis in b"WH")
            number = 0
            while line := source.readline():
                pixels = source.read(width * height)
                if number == LATE_FRAME:
                    gave_up.wait()
                sink.write(line + pixels), sink.flush()
                number += 1

    threading.Thread(target=relay, daemon=True).start()
    flight = subprocess.Popen([program, "--video", f"{name}={own}"], stdout=subprocess.PIPE, text=True)
    for line in flight.stdout:
        print(line, end="", flush=True)
        if "have not come" in line:
            gave_up.set()
    os.unlink(own)
    sys.exit(flight.wait())


def late_frame_is_not_taken_for_the_next():
    wrapped = f"{sys.executable} -B {__file__} late {program}"
    _, verdict, printed = rehearse("late", "--set", "scenario.duration_s=12.0", "--navigation", wrapped)
    expect("1 frames have not come" in printed, "a frame that is late in lockstep is no longer waited for")
    without, n = re.findall(r" (\d+\.\d+) s .*\(no frame\)", printed), verdict["navigation"]
    expect(without == [f"{LATE_FRAME:.3f}"] and n["with_frames"] == n["estimates"] - 1, f"only the cycle of {without} s was without its frame")
    expect(n["share_within"] == 1 and n["nees"] < 9, f"and the next frames have their own times: NEES {n['nees']:.2f}")


def aborts_without_lamps():
    status, verdict, printed = rehearse("dark", "--set", "camera.nav.detector.exposure_s=1e-9", "--set", "scenario.duration_s=60.0")
    failed = {g["name"]: g["reason"] for g in verdict["gates"] if g["state"] == "failed"}
    expect(status == 1 and "lost" in failed.get("complete", ""), f"black frames: it aborts, {failed}")
    expect("acquire -> abort: no lamps" in printed, "and says why")


def datagrams(number, height=240, width=320, rows=4):
    """The datagrams of a black frame."""
    count = height // rows
    for index in range(count):
        header = struct.pack("<4sHHqI4sHHIIIII", b"NRPD", 1, 52, number * 10**9, number, b"GREY", width, height, width, index, count, index * rows, 0)
        pixels = bytes(rows * width)
        yield header + struct.pack("<I", zlib.crc32(pixels, zlib.crc32(header))) + pixels


def counts_lost_datagrams():
    video, can = support.free_port(), support.free_port()
    lost = {0: set(), 1: {0}, 2: {3, 4, 59}, 3: set()}  # of each frame
    with support.Run(support.SCENE, "--can", f"slcan:{can}", "--video", f"{support.CAMERA}=none", "--lockstep"):
        command = [program, "--can", f"slcan:127.0.0.1:{can}", "--video", f"udp:{video}"]
        flight = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
        said = [line for line in iter(flight.stdout.readline, "ready\n")]
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as s:
            for number in lost:
                for index, datagram in enumerate(datagrams(number)):
                    if index not in lost[number]:
                        s.sendto(datagram, ("127.0.0.1", video))
                    s.sendto(datagram[:-1], ("127.0.0.1", video))  # damaged: its checksum is wrong
        for line in flight.stdout:
            said.append(line)
            if "frame 2" in line:
                flight.terminate()
        expect(flight.wait(60) == 0, "it ends when told to")
    told = [re.sub(r"^.*?(frame \d+: .*)\n", r"\1", line) for line in said if "datagrams lost" in line]
    expect(told[:2] == ["frame 1: 1 of 60 datagrams lost", "frame 2: 3 of 60 datagrams lost"], f"counted for each frame: {told[:2]}")
    expect("4 datagrams lost" in told[-1], "and in all")


def refuses(what, *arguments, status, **environment):
    clean = {k: v for k, v in os.environ.items() if k not in ("BUS", "VIDEO")}
    done = subprocess.run([program, *arguments], capture_output=True, text=True, env={**clean, **environment}, timeout=60)
    said = done.stdout + done.stderr
    expect(done.returncode == status and re.search(what, said), f"{' '.join(arguments)} {environment or ''}: {done.returncode}, {said.strip()[:160]!r}")


def refuses_bad_arguments():
    refuses("no bus", status=2)
    refuses("no frames", "--can", "can0", status=2)
    refuses("unknown argument --cam", "--cam", "can0", status=2)
    refuses("no value after --can", "--can", status=2)
    refuses("expected udp:PORT", "--can", "can0", "--video", "udp:70000", status=2)
    refuses("expected udp:PORT", "--can", "can0", "--video", "udp:5004x", status=2)
    refuses("No such file.*expected udp:PORT", "--can", "can0", "--video", "/nowhere", status=3)
    refuses("/dev/video99: No such file", "--can", "can0", "--video", "/dev/video99", status=3)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind(("", 0))
        refuses("Address already in use", "--can", "can0", "--video", f"udp:{taken.getsockname()[1]}", status=3)
    refuses("not a FIFO", "--can", "can0", "--video", __file__, status=2)
    refuses("no source of the camera", BUS="slcan:1", VIDEO="aft=udp:5004", status=2)
    refuses("expected slcan:HOST:PORT", "--video", f"udp:{support.free_port()}", BUS="udp:239.74.163.2", status=2)
    refuses("expected slcan:HOST:PORT", "--video", f"nav=udp:{support.free_port()}", "--can", "slcan:host:", status=2)


if sys.argv[1:2] == ["late"]:
    late(sys.argv[2])
build()
messages_are_those_of_the_dbc()
sets_are_those_of_python(fd=False)
sets_are_those_of_python(fd=True)
refuses_bad_arguments()
counts_lost_datagrams()
docks()
mission_is_that_of_the_scenario()
repeats_in_lockstep()
late_frame_is_not_taken_for_the_next()
aborts_without_lamps()
