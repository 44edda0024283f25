#!/usr/bin/python3
"""In the virtual machine: cansend commands poses on vcan0; the run survives vcan0 going down and up again. slcand makes a CAN
interface of narpa's pseudo-terminal. Of two redundant buses, vcan0 and vcan1, one goes down for good: no command is lost or used
twice."""
import subprocess
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "host"))
import can_devices
import support
from support import expect

POSES = support.flight(6)


def start(bus_spec, video):
    buses = [word for bus in bus_spec.split("+") for word in ("--can", bus)]
    return support.Run(support.SCENE, *buses, "--video", f"{support.CAMERA}={video}", "--lockstep")


def listen(run, interface):
    return support.open_bus(run, interface="socketcan", channel=interface, fd=interface.startswith("vcan"))


def cansend(interface, messages):
    for m in messages:
        text = f"{m.arbitration_id:03X}" + ("##1" if m.is_fd else "#") + bytes(m.data).hex()
        subprocess.run(["cansend", interface, text], check=True)


def link(*settings):
    subprocess.run(["ip", "link", "set", *settings], check=True)


def compare(video, folder, what):
    frames = support.read_y4m(video)
    wanted = [support.render(support.SCENE, k, POSES[k], folder) for k in range(len(frames))]
    expect(len(frames) > 0, f"{what}: frames came out")
    support.expect_frames(frames, wanted, what)


def vcan(wire):
    folder = support.work_folder()
    video = folder / "nav.y4m"
    link("vcan0", "txqueuelen", "10")  # the default of real interfaces
    with start("vcan0", video) as run:
        run.wait_for("vcan0 .*queue of 10 frames.*ip link set vcan0 txqueuelen 1000")
        link("vcan0", "txqueuelen", "1000")
        bus = listen(run, "vcan0")
        for frame in range(4):
            cansend("vcan0", wire.command(POSES[frame], frame * support.PERIOD_NS, frame, fd=frame % 2 == 1))
            support.await_ledger(bus, wire, frame)
        expect(True, "cansend commands four frames, classic and FD by turns")
        bus.shutdown()

        link("vcan0", "down")
        time.sleep(0.5)
        run.expect_alive()
        link("vcan0", "up")
        time.sleep(0.5)
        bus = listen(run, "vcan0")
        for frame in (4, 5):
            for message in wire.command(POSES[frame], frame * support.PERIOD_NS, frame, fd=frame % 2 == 1):
                bus.send(message)
            support.await_ledger(bus, wire, frame)
        summary = run.stop()
        bus.shutdown()
    print(f"vcan0: {summary['can']}")
    expect(summary["can"]["interface_down"] >= 1, "the summary counts that vcan0 went down")
    expect(summary["can"]["commands_taken"] == 6, "six commands were taken, two of them after vcan0 came up")
    compare(video, folder, "vcan0, cansend and python-can")


def slcand(wire):
    folder = support.work_folder()
    video = folder / "nav.y4m"
    with start(f"slcan:{support.free_port()}", video) as run:
        pty = run.wait_for(r"/dev/pts/\d+").group()
        daemon = subprocess.Popen(["slcand", "-F", "-o", "-c", "-s6", pty, "slcan0"])
        while subprocess.run(["ip", "link", "set", "slcan0", "up"], capture_output=True).returncode != 0:
            expect(daemon.poll() is None, "slcand runs")
            time.sleep(0.2)
        bus = listen(run, "slcan0")
        for frame in range(3):
            for message in wire.command(POSES[frame], frame * support.PERIOD_NS, frame):
                bus.send(message)
            support.await_ledger(bus, wire, frame)
        bus.shutdown()
        # Ended while narpa still has the other end open: slcand cannot release a terminal that has hung up.
        daemon.terminate()
        daemon.wait(timeout=10)
        print(f"slcan0: {run.stop()['can']}")
    compare(video, folder, f"slcan0, slcand on {pty}")


def redundant(wire):
    """Each command goes out on both buses, until vcan0 is cut after four of six."""
    folder = support.work_folder()
    video = folder / "nav.y4m"
    can_devices.add_bus("vcan1")
    frames = [wire.command(POSES[k], k * support.PERIOD_NS, k, fd=k % 2 == 1) for k in range(6)]
    before, after = (sum(map(len, part)) for part in (frames[:4], frames[4:]))
    with start("vcan0+vcan1", video) as run:
        buses = [listen(run, interface) for interface in ("vcan0", "vcan1")]
        listeners = [support.Wire() for _ in buses]  # of their own: a decoder joins the frames of one bus
        for frame, messages in enumerate(frames):
            if frame == 4:
                can_devices.cut("vcan0")
                buses.pop(0).shutdown()
                listeners.pop(0)
            for bus in buses if frame % 2 else buses[::-1]:
                for message in messages:
                    bus.send(message)
            for bus, listener in zip(buses, listeners):
                support.await_ledger(bus, listener, frame)
        expect(True, "ledgers came on both buses, and on vcan1 after vcan0 was cut")
        can = run.stop()["can"]
        buses[0].shutdown()
    print(f"vcan0+vcan1: {can}")
    taken, missed, rejected = can["commands_taken"], can["commands_missed"], sum(can["rejected"].values())
    expect((taken, missed, rejected) == (6, 0, 0), f"{taken} commands were taken, {missed} missed, {rejected} rejected")
    a, b = can["buses"]
    expect(a["frames_used"] + a["duplicates"] == before, f"of A all {before} frames before the cut were counted: {a}")
    expect(b["frames_used"] + b["duplicates"] == before + after, f"of B all {before + after} frames were counted: {b}")
    expect(a["frames_used"] + b["frames_used"] == before + after, "each frame was used once")
    expect(a["interface_down"] == 1 and b["interface_down"] == 0, "A went down, B did not")
    expect(b["frames_sent"] > a["frames_sent"] > 0, f"sent: {a['frames_sent']} frames on A, {b['frames_sent']} on B")
    compare(video, folder, "vcan0 and vcan1, of which one is cut")
    link("vcan0", "up")


wire = support.Wire()
vcan(wire)
slcand(wire)
redundant(wire)
