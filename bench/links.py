#!/usr/bin/python3
"""Frames from narpa in one network namespace to a receiver in another, joined by a veth pair: what came of what was sent, how long
after the hand-over a frame was whole at the receiver, and what it cost of a processor. The frames are test patterns of 12 bits:
rendering costs nothing.

    sudo unshare --net bench/links.py BIN_FOLDER [SECONDS [check]]

Receivers: udp: examples/frame_receiver in C; rtp: and tcp: Python; gige: Aravis's client. Prints a table in Markdown. With `check` they
are all in Python, and at a lower rate compare every pixel with the pattern; a frame with another pixel does not count as whole."""
import csv
import json
import math
import os
import queue
import re
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "python"))
HERE, THERE, MTU = "10.20.30.1", "10.20.30.2", 9000
SCENE = """
[time]
source = "system"
[sun]
direction = [-1, 0.5, 0.7]
[[body]]
name = "target"
sphere = {{radius_m = 2}}
[[camera]]
name = "nav"
position_m = [-10, 0, 0]
attitude_wxyz = [0.5, -0.5, 0.5, -0.5]
resolution = [{width}, {height}]
fov_horizontal_deg = 40
rate_hz = {rate}
format = "{format}"
embedded_line = {embedded}
test_pattern = "counter"
detector = {{bits = 12, exposure_s = 0.001}}
"""
SINKS = {  # sink, pixel format; frames of rtp: and gige: name themselves
    "udp": (f"udp:{THERE}:5004,mtu={MTU}", "Y12P", False),
    "rtp": (f"rtp:{THERE}:5006,mtu={MTU},{{pace}}sdp={{folder}}/nav.sdp", "Y12", False),
    "tcp": (f"tcp:{HERE}:5008", "Y12", True),
    "gige": (f"gige:{HERE}", "Mono12p", False),
}


def inside(*command):
    """The command in the receiver's namespace."""
    return ["nsenter", f"--net=/proc/{HOLDER.pid}/ns/net", *map(str, command)]


def join_namespaces():
    """A process that holds the receiver's namespace open."""
    holder = subprocess.Popen(["unshare", "--net", "sleep", "infinity"])
    while os.readlink(f"/proc/{holder.pid}/ns/net") == os.readlink("/proc/self/ns/net"):
        time.sleep(0.01)

    def ip(*words):
        subprocess.run(["ip", *words], check=True)

    ip("link", "set", "lo", "up")
    ip("link", "add", "v0", "mtu", str(MTU), "type", "veth", "peer", "name", "v1", "mtu", str(MTU), "netns", str(holder.pid))
    ip("addr", "add", f"{HERE}/24", "dev", "v0")
    ip("link", "set", "v0", "up")
    for words in ("link set lo up", f"addr add {THERE}/24 dev v1", "link set v1 up"):
        subprocess.run(["nsenter", f"--net=/proc/{holder.pid}/ns/net", "ip", *words.split()], check=True)
    return holder


# Each gives, of each frame that ends: its number, whether it came whole, and what returns its pixels.


def receive_udp(_):
    from narpa import datagrams

    for frame in datagrams.receive(5004):
        yield frame.header.frame, frame.lost == 0, lambda: frame.pixels  # noqa: B023  (it is called before the next)


def receive_rtp(sdp):
    from narpa import rtp

    while not Path(sdp).exists():
        time.sleep(0.05)
    for frame in rtp.receive(rtp.read_sdp(Path(sdp).read_text())):
        yield frame.number, frame.came.all(), lambda: frame.planes  # noqa: B023


def receive_tcp(address):
    host, port = address.split(":")
    for _ in range(400):
        try:
            s = socket.create_connection((host, int(port)))
            break
        except OSError:
            time.sleep(0.05)
    stream = s.makefile("rb", buffering=1 << 20)
    width, height = map(int, re.search(rb" W(\d+) H(\d+) ", stream.readline()).groups())
    frame = bytearray(2 * width * height)
    while stream.readline() == b"FRAME\n" and stream.readinto(frame) == len(frame):
        number = int.from_bytes(frame[-2 * width :][12:16], "little")  # by its embedded line
        yield number, True, lambda: np.frombuffer(frame, "<u2").reshape(height, width)


def receive_gige(_):
    import gi

    gi.require_version("Aravis", "0.8")
    from gi.repository import Aravis
    from narpa import pixels

    for _ in range(100):
        try:
            camera = Aravis.Camera.new(HERE)
            break
        except Exception:  # not there yet
            time.sleep(0.1)
    camera.gv_set_packet_size(MTU - 36)
    stream, payload = camera.create_stream(None, None), camera.get_payload()
    for _ in range(20):
        stream.push_buffer(Aravis.Buffer.new_allocate(payload))
    _, _, width, height = camera.get_region()
    camera.start_acquisition()
    while True:
        buffer = stream.timeout_pop_buffer(2_000_000)
        if buffer is None:
            continue
        whole = buffer.get_status() == Aravis.BufferStatus.SUCCESS
        yield buffer.get_frame_id() - 1, whole, lambda: pixels.array("Mono12p", width, height, bytes(buffer.get_data()))  # noqa: B023
        stream.push_buffer(buffer)


def is_pattern(number, pixels, name):
    same = pixels == ((np.arange(pixels.size) + number) % 4096).reshape(pixels.shape)
    if name == "tcp":  # its embedded line
        same[-1, :80] = True
    return same.all()


def receive(name, where, checks):
    """Prints time, number and whether it came whole of each frame."""
    for number, whole, pixels in {"udp": receive_udp, "rtp": receive_rtp, "tcp": receive_tcp, "gige": receive_gige}[name](where):
        now = time.time_ns()
        print(now, number, int(whole and (not checks or is_pattern(number, pixels(), name))), flush=True)


def receiver_of(name, folder):
    if name == "udp" and not CHECKS:
        return [folder / "receive", "5004"]
    where = {"rtp": folder / "nav.sdp", "tcp": f"{HERE}:5008"}.get(name, "")
    return [sys.executable, __file__, "receive", name, where, *(["check"] if CHECKS else [])]


def cpu_s(process):
    """Processor seconds of a process that is waited for here."""
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    return usage.ru_utime + usage.ru_stime


def percentile(values, p):
    """By nearest rank."""
    values = sorted(values)
    return values[math.ceil(p * len(values)) - 1] if values else float("nan")


def run(name, size, rate, seconds, narpa, folder):
    sink, pixel_format, embedded = SINKS.get(name, ("none", "Y12", False))
    scene, log = folder / "scene.toml", folder / f"{name}-{size[0]}"
    scene.write_text(SCENE.format(width=size[0], height=size[1], rate=rate, format=pixel_format, embedded=str(embedded).lower()))
    (folder / "nav.sdp").unlink(missing_ok=True)
    arrivals, receiver = [], None
    if name != "none":
        receiver = subprocess.Popen([str(c) for c in inside(*receiver_of(name, folder))], stdout=subprocess.PIPE, text=True)

        def read():
            for line in receiver.stdout:
                now = time.time_ns()
                if m := re.match(r"frame (\d+): .* (\d+) of \d+ datagrams lost", line):
                    arrivals.append((now, int(m[1]), int(m[2] == "0")))
                else:
                    arrivals.append(tuple(map(int, line.split())))

        reader = threading.Thread(target=read)
        reader.start()
        time.sleep(1)
    video = "nav=" + sink.format(folder=folder, pace="mbit_s=300," if CHECKS else "")  # Python is slow
    emulator = subprocess.Popen([str(c) for c in (narpa, "run", scene, "--video", video, "--duration", seconds,
                                 "--threads", "1", "--log", log, "--json")], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)  # fmt: skip
    out, err = queue.Queue(), []
    threading.Thread(target=lambda: out.put(emulator.stdout.read()), daemon=True).start()
    threading.Thread(target=lambda: err.append(emulator.stderr.read()), daemon=True).start()
    spent = cpu_s(emulator)
    if emulator.returncode != 0:
        print(f"{name}: narpa ended with {emulator.returncode}\n{''.join(err)[-1500:]}", file=sys.stderr)
    of_receiver = 0.0
    if receiver:
        time.sleep(1)
        os.kill(receiver.pid, signal.SIGTERM)  # not send_signal, which would take its exit status
        of_receiver = cpu_s(receiver)
        reader.join()
    report = json.loads(out.get())
    with open(log / "nav.ledger.csv") as f:
        rows = {int(r["frame"]): r for r in csv.DictReader(f)}
    latency_ms = [1e-6 * (t - int(rows[n]["utc_offset_ns"]) - int(rows[n]["t_hand_over_ns"])) for t, n, whole in arrivals if whole and n in rows]
    counts = report["cameras"][0]["sinks"][0] if name != "none" else {}
    return {"frames": len(rows), "written": counts.get("written", len(rows)), "whole": sum(w for _, _, w in arrivals), "counts": counts,
            "latency_ms": latency_ms, "cpu_ms": 1e3 * spent / len(rows), "receiver_ms": 1e3 * of_receiver / len(rows)}  # fmt: skip


def main():
    narpa, seconds = Path(sys.argv[1]) / "narpa", int(sys.argv[2]) if len(sys.argv) > 2 else 30
    folder = Path(tempfile.mkdtemp(prefix="narpa-links-"))
    subprocess.run(["cc", "-O2", "-o", folder / "receive", ROOT / "examples/frame_receiver/receive.c"], check=True)
    print("| frames | sink | sent | whole | latency p50, p99 (ms) | processor, a frame: narpa, receiver (ms) |\n|---|---|---|---|---|---|")
    for size, rate in (((640, 480), 2), ((2048, 1536), 0.5)) if CHECKS else (((640, 480), 10), ((2048, 1536), 5)):
        base = run("none", size, rate, seconds, narpa, folder)
        for name in SINKS:
            r = run(name, size, rate, seconds, narpa, folder)
            lost = {k: v for k, v in r["counts"].items() if ("drop" in k or "fail" in k) and v}
            print(f"| {size[0]} x {size[1]}, {rate} Hz | `{name}:` {SINKS[name][1]} | {r['written']} of {r['frames']}{f' {lost}' if lost else ''} | {r['whole']} | "
                  f"{percentile(r['latency_ms'], 0.5):.1f}, {percentile(r['latency_ms'], 0.99):.1f} | {r['cpu_ms'] - base['cpu_ms']:.1f}, {r['receiver_ms']:.1f} |", flush=True)  # fmt: skip
    shutil.rmtree(folder)


CHECKS = sys.argv[-1] == "check"
if sys.argv[1:2] == ["receive"]:
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(0))
    receive(sys.argv[2], sys.argv[3], CHECKS)
else:
    HOLDER = join_namespaces()
    try:
        main()
    finally:
        HOLDER.kill()
