#!/usr/bin/python3
"""What a scene of many bodies costs: time before the first frame, memory, and CPU time of frames and LiDAR sweeps.

Usage: bench/many_bodies.py [--narpa BIN] [--bodies 1,10,100,1000,10000] [--json FILE]

The bodies are cubes of one mesh, at random places of a ball of 20 m, moved by one trajectory file. Their size shrinks as
their number grows, so that together they always cover the same share of the image. A camera of 512 x 512 pixels and a
LiDAR are 60 m away. Time is CPU time, which other load on the machine disturbs least; a frame's is that of `narpa render`
with 4 samples a pixel, minus that of a camera that looks away. The last row is the exponent p of cost ~ bodies^p over the
last tenfold. A table goes to standard output.
"""
import argparse
import json
import math
import os
import pathlib
import random
import subprocess
import sys
import tempfile

RADIUS_M, DISTANCE_M, COVER = 20.0, 60.0, 0.6
REPEATS = 3
CUBE = [(1, 2, 4, 3), (5, 7, 8, 6), (1, 5, 6, 2), (3, 4, 8, 7), (1, 3, 7, 5), (2, 6, 8, 4)]
HEADER = "t_s,body,x_m,y_m,z_m,qw,qx,qy,qz,vx_m_s,vy_m_s,vz_m_s,wx_rad_s,wy_rad_s,wz_rad_s\n"


def scene(folder, bodies):
    rng = random.Random(bodies)
    corners = [(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
    obj = "".join("v %d %d %d\n" % c for c in corners) + "".join("f %d %d %d %d\n" % f for f in CUBE)
    (folder / "cube.obj").write_text(obj)
    rows = [HEADER]
    for i in range(bodies):
        v = [rng.gauss(0, 1) for _ in range(3)]
        reach = RADIUS_M * rng.random() ** (1 / 3) / math.hypot(*v) if bodies > 1 else 0.0
        q = [rng.gauss(0, 1) for _ in range(4)]
        numbers = [reach * x for x in v] + [x / math.hypot(*q) for x in q] + [rng.gauss(0, 0.1) for _ in range(6)]
        rows.append("0,c%d," % i + ",".join("%.6f" % x for x in numbers) + "\n")
    (folder / "motion.csv").write_text("".join(rows))
    half_m = COVER * RADIUS_M / math.sqrt(1.5 * bodies)  # of a cube, whose mean shadow is 1.5 times a face
    camera = 'position_m = [0, 0, %g]\nresolution = [512, 512]\nfov_horizontal_deg = 40\n' % -DISTANCE_M
    path = folder / "scene.toml"
    path.write_text(f"""
[sun]
direction = [0.4, -0.5, -0.8]
[[body]]
name = "c*"
mesh = "cube.obj"
scale = {half_m}
material = {{kind = "lambert", albedo = 0.5}}
trajectory = "motion.csv"
[[camera]]
name = "field"
{camera}
[[camera]]
name = "away"
attitude_wxyz = [0, 1, 0, 0]
{camera}
[[lidar]]
name = "scanner"
position_m = [0, 0, {-DISTANCE_M}]
attitude_wxyz = [0.70710678, 0.70710678, 0, 0]
model = "VLP-16"
range_max_m = 120
""")
    return path


def run(command):
    """CPU seconds and memory in MB of a command."""
    with tempfile.TemporaryFile() as errors:
        child = subprocess.Popen([str(c) for c in command], stdout=subprocess.DEVNULL, stderr=errors)
        _, status, used = os.wait4(child.pid, 0)
        child.returncode = os.waitstatus_to_exitcode(status)
        if child.returncode != 0:
            errors.seek(0)
            sys.exit(errors.read().decode())
        return used.ru_utime + used.ru_stime, used.ru_maxrss / 1024


def costs(narpa, folder, bodies):
    path = scene(folder, bodies)

    def render(camera, method):
        """Least CPU time of some processes, s, and the memory of one."""
        used = [run([narpa, "render", path, "--threads", 1, "--spp", 4, "--camera", camera, "--method", method, "-o",
                     folder / "frame.raw"]) for _ in range(REPEATS)]
        return min(u[0] for u in used), used[0][1]

    def sweep(turns):
        return min(run([narpa, "scan", path, "--duration", 0.1 * turns, "-o", folder / "sweep.pcap"])[0] for _ in range(REPEATS))

    start_s, megabytes = render("away", "direct")
    return {"bodies": bodies, "start_s": start_s, "memory_mb": megabytes, "direct_ms": 1e3 * (render("field", "direct")[0] - start_s),
            "path_ms": 1e3 * (render("field", "path")[0] - start_s), "sweep_ms": 1e3 * (sweep(6) - sweep(1)) / 5}


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--narpa", default="build/release/bin/narpa", type=pathlib.Path)
    parser.add_argument("--bodies", default="1,10,100,1000,10000")
    parser.add_argument("--json", type=pathlib.Path)
    options = parser.parse_args()
    columns = {"start_s": "before the first frame, s", "memory_mb": "memory, MB", "direct_ms": "frame, direct, ms",
               "path_ms": "frame, path, ms", "sweep_ms": "LiDAR turn, ms"}
    print("| bodies | " + " | ".join(columns.values()) + " |\n|" + "---|" * (len(columns) + 1), flush=True)
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for bodies in (int(n) for n in options.bodies.split(",")):
            rows.append(costs(options.narpa, pathlib.Path(folder), bodies))
            print(f"| {bodies} | " + " | ".join(f"{rows[-1][key]:.3g}" for key in columns) + " |", flush=True)
    if len(rows) > 1:
        last, before = rows[-1], rows[-2]
        tenfold = math.log(last["bodies"] / before["bodies"])
        slope = {key: math.log(max(last[key], 1e-3) / max(before[key], 1e-3)) / tenfold for key in columns}
        print("| exponent | " + " | ".join(f"{slope[key]:.2f}" for key in columns) + " |")
    if options.json:
        options.json.write_text(json.dumps(rows, indent=2) + "\n")


if __name__ == "__main__":
    main()
