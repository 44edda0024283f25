#!/usr/bin/python3
"""Unmodified python-can commands poses over slcan (classic frames) and over udp_multicast (CAN FD). The rendered frames
are byte-identical to `narpa render` at those poses.

Usage: commands.py slcan|udp_multicast
"""
import subprocess
import sys

import support
from support import expect

POSES = support.flight(10)
FIRST_FRAME = 3  # lockstep begins with the first command, not with frame 0


def command_and_compare(bus_spec, bus_settings, fd):
    name = f"{bus_settings['interface']}, {'CAN FD' if fd else 'classic'}"
    folder = support.work_folder()
    wire = support.Wire()
    video = folder / "nav.y4m"
    with support.Run(support.SCENE, "--can", bus_spec, "--video", f"{support.CAMERA}={video}", "--lockstep") as run:
        run.wait_for("commands: ")  # narpa receives from now on
        bus = support.open_bus(run, **bus_settings)
        for i, pose in enumerate(POSES):
            frame = FIRST_FRAME + i
            t_ns = frame * support.PERIOD_NS
            for message in wire.command(pose, t_ns, counter=250 + i, fd=fd):
                bus.send(message)
            ledger = support.await_ledger(bus, wire, frame)
            expect(ledger["PoseCounter"] == (250 + i) % 256, f"{name}: ledger of frame {frame} names its command")
        summary = run.stop()
        bus.shutdown()
    expect(" frames received" in run.stderr() and "deadline" not in run.stderr(), f"{name}: the summary of lockstep has no deadlines")
    counts = summary["can"]
    print(f"{name}: {counts}")
    expect(counts["commands_taken"] == len(POSES) and counts["commands_missed"] == 0, f"{name}: all commands taken, none missed")
    expect(not any(counts["rejected"].values()), f"{name}: nothing rejected")
    frames = support.read_y4m(video)
    wanted = [support.render(support.SCENE, FIRST_FRAME + i, pose, folder) for i, pose in enumerate(POSES)]
    support.expect_frames(frames, wanted, name)
    elsewhere = support.render(support.SCENE, FIRST_FRAME, POSES[-1], folder)  # same frame number and noise, another pose
    expect(elsewhere != wanted[0], f"{name}: and a frame at another pose differs")


def slcan():
    port = support.free_port()
    settings = {"interface": "slcan", "channel": f"socket://127.0.0.1:{port}", "sleep_after_open": 0.1}
    command_and_compare(f"slcan:{port}", settings, fd=False)


def udp_multicast():
    # python-can selects the interface by the routing table: a network namespace leaves the machine's table unchanged.
    subprocess.run(["ip", "link", "set", "lo", "up"], check=True)
    subprocess.run(["ip", "route", "add", "239.74.163.2/32", "dev", "lo", "src", "127.0.0.1"], check=True)
    command_and_compare("udp:239.74.163.2", {"interface": "udp_multicast", "channel": "239.74.163.2"}, fd=True)


match sys.argv[1:]:
    case ["slcan"]:
        slcan()
    case ["udp_multicast"]:
        support.enter_own_network(__file__, "udp_multicast", "inside")
    case ["udp_multicast", "inside"]:
        udp_multicast()
    case _:
        sys.exit(f"usage: {sys.argv[0]} slcan|udp_multicast")
