#!/usr/bin/python3
"""In the virtual machine: the system's clock is stepped, slewed and has a leap second while narpa runs with its UTC. No exposure
moves; UTC in ledgers, packets and on CAN is right afterwards."""
import ctypes
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "host"))
import support
from support import expect

SCENE = """
[sun]
direction = [-1, 0.5, 0.7]
[[body]]
name = "target"
sphere = {radius_m = 2}
material = {kind = "lambert", albedo = 0.6}
[[camera]]
name = "nav"
position_m = [-10, 0, 0]
attitude_wxyz = [0.5, -0.5, 0.5, -0.5]
resolution = [32, 24]
fov_horizontal_deg = 40
rate_hz = 5
[[lidar]]
name = "beam"
position_m = [-10, 0, 0]
attitude_wxyz = [0.7071067811865476, 0, 0, -0.7071067811865476]
model = "beam.toml"
[time]
source = "system"
"""
BEAM = """
[lidar]
name = "altimeter"
rate_hz = 10.0
range_max_m = 100.0
range_resolution_m = 0.01
[[beam]]
azimuth_deg = 0.0
elevation_deg = 0.0
phase = 0.0
"""
HOUR_NS, SECOND_NS = 3600 * 10**9, 10**9


class Timex(ctypes.Structure):
    """struct timex of adjtimex(2) on 64-bit Linux."""

    _fields_ = [("modes", ctypes.c_uint)] + [(name, ctypes.c_long) for name in "offset freq maxerror esterror".split()] + \
        [("status", ctypes.c_int)] + [(name, ctypes.c_long) for name in "constant precision tolerance sec usec tick ppsfreq jitter".split()] + \
        [("shift", ctypes.c_int)] + [(name, ctypes.c_long) for name in "stabil jitcnt calcnt errcnt stbcnt".split()] + \
        [("tai", ctypes.c_int), ("rest", ctypes.c_int * 11)]  # fmt: skip


ADJ_FREQUENCY, ADJ_MAXERROR, ADJ_ESTERROR, ADJ_STATUS = 0x2, 0x4, 0x8, 0x10
STA_INS, STA_UNSYNC = 0x10, 0x40
libc = ctypes.CDLL(None, use_errno=True)


def adjust(modes=0, **values):
    timex = Timex(modes=modes, **values)
    if libc.adjtimex(ctypes.byref(timex)) < 0:
        raise OSError(ctypes.get_errno(), "adjtimex")
    return timex


def step(seconds):
    time.clock_settime_ns(time.CLOCK_REALTIME, time.clock_gettime_ns(time.CLOCK_REALTIME) + round(seconds * SECOND_NS))


def offset_ns():
    return time.clock_gettime_ns(time.CLOCK_REALTIME) - time.clock_gettime_ns(time.CLOCK_MONOTONIC)


def changes(rows):
    """The values of utc_offset_ns in their order, each once, less the first."""
    values = [int(row["utc_offset_ns"]) for row in rows]
    return [b - a for a, b in zip(values, values[1:]) if a != b]


def expect_steps(rows, wanted, what):
    got = changes(rows)
    # The clock is set to what it says plus the step, a few milliseconds of emulated work later.
    good = len(got) == len(wanted) and all(abs(g - w) < 0.2 * SECOND_NS for g, w in zip(got, wanted))
    expect(good, f"{what}: UTC steps by {[w / SECOND_NS for w in wanted]} s ({[g / SECOND_NS for g in got]})")


def records(capture):
    """Times of a capture's records, ns."""
    data, at, times = capture.read_bytes(), 24, []
    while at + 16 <= len(data):
        seconds, fraction, size, _ = (int.from_bytes(data[at + 4 * i : at + 4 * i + 4], "little") for i in range(4))
        times.append(seconds * SECOND_NS + fraction)
        at += 16 + size
    return times


def await_clock_report(bus):
    """The simulation clock runs once narpa reports it."""
    until = time.monotonic() + 120
    while time.monotonic() < until:
        message = bus.recv(1)
        if message is not None and 0x7B0 <= message.arbitration_id < 0x7C0:
            return
    expect(False, "a clock report on CAN")


def main():
    from narpa.logs import read_table

    folder = support.work_folder()
    (folder / "scene.toml").write_text(SCENE)
    (folder / "beam.toml").write_text(BEAM)
    log, capture = folder / "log", folder / "beam.pcap"
    time.clock_settime(time.CLOCK_REALTIME, 1_796_169_590)  # 2026-12-01T23:59:50Z
    # As one that disciplines the clock says, until the clock is set again.
    adjust(ADJ_STATUS | ADJ_MAXERROR | ADJ_ESTERROR, status=0, maxerror=900, esterror=12)
    with support.Run(folder / "scene.toml", "--can", "vcan0", "--video", "nav=none", "--lidar", f"beam={capture}",
                     "--log", log) as run:  # fmt: skip
        run.wait_for("vcan0")
        bus = support.open_bus(run, interface="socketcan", channel="vcan0", fd=True)
        await_clock_report(bus)
        step(3600), time.sleep(2)
        step(-3600), time.sleep(2)
        adjust(ADJ_FREQUENCY, freq=500 * 65536)
        time.sleep(2)
        adjust(ADJ_FREQUENCY, freq=0)
        time.clock_settime(time.CLOCK_REALTIME, 1_796_169_597)  # 23:59:57
        adjust(ADJ_STATUS, status=STA_INS)  # 23:59:60 follows 23:59:59
        time.sleep(6)
        adjust(ADJ_STATUS, status=STA_UNSYNC)
        time.sleep(1)
        end_ns = offset_ns()
        summary = run.stop()
    frames, sweeps = read_table(log / "nav.ledger.csv"), read_table(log / "beam.sweeps.csv")
    expect(len(frames) > 10, f"{len(frames)} frames, {len(sweeps)} sweeps")
    off_grid = [row for row in frames if int(row["t_exposure_mid_ns"]) != int(row["frame"]) * 200_000_000]
    expect(not off_grid, "every exposure is at a whole multiple of its period")
    set_back = changes(frames)[2] if len(changes(frames)) == 4 else 0  # to 23:59:57, from whatever it was
    wanted = [HOUR_NS, -HOUR_NS, set_back, -SECOND_NS]
    expect_steps(frames, wanted, "frames")
    expect_steps(sweeps, wanted, "sweeps")
    # Two clocks cannot be read at one instant; what a reading is off by is far below a microsecond.
    expect(abs(changes(frames)[3] + SECOND_NS) < 2000, "the leap second is one second to a microsecond")
    # The offset that the last frames state is the system's own.
    clock = summary["clock"]
    start = int(frames[-1]["utc_offset_ns"]) - end_ns  # simulation time 0 on CLOCK_MONOTONIC
    first = int(frames[0]["utc_offset_ns"])
    expect(first % SECOND_NS == 0, "the run begins at a whole UTC second")
    expect(0 < start < time.clock_gettime_ns(time.CLOCK_MONOTONIC), "the last UTC is that of the system's clock")
    expect(clock["steps"] == 4 and clock["source"] == "system", f"the report counts the steps: {clock}")
    errors = [row["utc_error_ns"] for row in frames]
    expect(errors[0] == 12000 and -1 in errors, f"the error is the kernel's, then not known: {sorted(set(errors))}")
    times = records(capture)
    jumps = [round((b - a) / SECOND_NS) for a, b in zip(times, times[1:]) if abs(b - a) > 0.7 * SECOND_NS]
    expect(jumps[:2] == [3600, -3600], f"UTC of packets follows: {jumps}")
    expect(any("stepped during the run, 4 times" in notice for notice in summary["notices"]), "a notice says so")


if __name__ == "__main__":
    main()
