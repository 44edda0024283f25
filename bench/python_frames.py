#!/usr/bin/python3
"""Time of a frame within Python, beside that of a C++ loop and of `narpa render` as a process.

Usage: PYTHONPATH=build/release/python bench/python_frames.py [FRAMES] [THREADS] [KEY=VALUE...]

FRAMES: default 1000, of 320 x 240. THREADS: that trace rays, default 1. KEY=VALUE: keys of the scene, as `--set`. Python and C++
take turns in ten rounds, and the ratio is that of each round, because other load on the machine changes from minute to minute.
CPU time depends less on that load than wall time.
"""
import json
import statistics
import subprocess
import sys
import time
from pathlib import Path

import narpa

frames = int(sys.argv[1]) if len(sys.argv) > 1 else 1000
threads = int(sys.argv[2]) if len(sys.argv) > 2 else 1
sets = ["camera.nav.resolution=[320, 240]", *sys.argv[3:]]
program = Path(narpa.__file__).parents[1].parent / "bin/narpa"
options = ["--threads", str(threads), *(text for s in sets for text in ("--set", s))]
ROUNDS = 10
IMAGE = "/dev/shm/narpa-frame.raw"


def in_cpp():
    """Wall and CPU time of a frame, ms."""
    command = [program, "bench", "frames", "docking", "--frames", str(frames // ROUNDS), "--json", *options]
    found = json.loads(subprocess.run(command, check=True, capture_output=True).stdout)
    return found["ms_mean"], found["cpu_ms_mean"]


def in_python():
    wall, cpu = time.perf_counter(), time.process_time()
    for k in range(frames // ROUNDS):
        scene.render("nav", time_s=k * period_s, frame=k)
    return [1e3 * (now() - then) / (frames // ROUNDS) for now, then in ((time.perf_counter, wall), (time.process_time, cpu))]


def as_process():
    start = time.perf_counter()
    subprocess.run([program, "render", "docking", "-o", IMAGE, *options], check=True, capture_output=True)
    return 1e3 * (time.perf_counter() - start)


scene = narpa.load_scene("docking", dict(s.split("=", 1) for s in sets), threads=threads)
period_s = 1 / scene.camera("nav").rate_hz
scene.render("nav")  # allocates
rounds = [(in_python(), in_cpp()) for _ in range(ROUNDS)]
for kind, name in enumerate(("wall", "CPU")):
    python, cpp = (statistics.median(r[side][kind] for r in rounds) for side in (0, 1))
    ratios = sorted(r[0][kind] / r[1][kind] for r in rounds)
    print(f"{name} time of a frame: {python:.3f} ms within Python, {cpp:.3f} ms in C++; ratio {statistics.median(ratios):.3f} "
          f"({ratios[1]:.3f} to {ratios[-2]:.3f} without the extremes)")  # fmt: skip
print(f"narpa render as a process: {statistics.median(as_process() for _ in range(5)):.0f} ms")
Path(IMAGE).unlink()
