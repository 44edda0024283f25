#!/usr/bin/python3
"""In the virtual machine: cansend commands poses on vcan0; the run survives vcan0 going down and up again. slcand makes a CAN
interface of narpa's pseudo-terminal."""
import subprocess
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "host"))
import support
from support import expect

POSES = support.flight(6)


def start(bus_spec, video):
    return support.Run(support.SCENE, "--can", bus_spec, "--video", f"{support.CAMERA}={video}", "--lockstep")


def listen(run, interface):
    return support.open_bus(run, interface="socketcan", channel=interface, fd=interface == "vcan0")


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


wire = support.Wire()
vcan(wire)
slcand(wire)
