#!/usr/bin/python3
"""How time and memory grow with what a scene has: triangles, bodies, lights, pixels, cameras, sub-rays, threads.

Usage: bench/cost_laws.py [LAW...] [--quick] [--json FILE] [--plot FILE.png] [--build FOLDER]

Makes the scenes and measures each size in a process of its own. Times are the least CPU time of some frames after a first one, which
other load on the machine disturbs least; those of `threads` are also wall time. Memory is the largest that the process had resident,
less what it had before it loaded the scene. Prints a table for each law; its last row is the exponent p of cost ~ size^p, from the
last tenfold of the sizes.
"""
import argparse
import json
import math
import os
import random
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
SUN = "[sun]\ndirection = [0.4, -0.5, -0.8]\n"
LAWS = {}  # name: (sizes, sizes of --quick, function of a size, a folder and the build that returns what to measure)


def law(sizes, quick):
    def add(function):
        LAWS[function.__name__.replace("_", "-")] = (sizes, quick, function)
        return function

    return add


def camera(distance_m, pixels, fov_deg=40, name="nav"):
    """Looks along z at the origin."""
    return (f'[[camera]]\nname = "{name}"\nposition_m = [0, 0, {-distance_m}]\nresolution = [{pixels}, {pixels}]\n'
            f'fov_horizontal_deg = {fov_deg}\nformat = "GREY"\nwhite_radiance = 1.0\n')  # fmt: skip


def written(folder, text):
    path = folder / "scene.toml"
    path.write_text(text)
    return str(path)


DIRECT, PATH = {"render.method": "direct", "render.spp": 4}, {"render.method": "path", "render.spp": 4, "render.max_depth": 8}
FRAMES = {"frame, direct, ms": DIRECT, "frame, path, ms": PATH}


# --- The laws ---


@law([10**4, 10**5, 10**6, 10**7], [1000, 10**4])
def triangles(n, folder, build):
    """A sphere with noise fills a view of 512 x 512 pixels."""
    vertices, faces = sphere(n)
    rows = np.empty(len(faces), np.dtype([("count", "u1"), ("corners", "<i4", 3)]))
    rows["count"], rows["corners"] = 3, faces
    head = (f"ply\nformat binary_little_endian 1.0\nelement vertex {len(vertices)}\nproperty float x\nproperty float y\n"
            f"property float z\nelement face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n")  # fmt: skip
    (folder / "mesh.ply").write_bytes(head.encode() + vertices.tobytes() + rows.tobytes())
    scene = written(folder, SUN + '[[body]]\nname = "body"\nmesh = "mesh.ply"\n' + camera(400, 512, 26))
    return {"scene": scene, "frames": FRAMES, "load": True}


def sphere(n_triangles):
    """Vertices (float32, about 100 m from the middle) and faces (int32) of an octahedron whose faces are cut into n^2 each."""
    n = max(1, round((n_triangles / 8) ** 0.5))
    a, b = np.meshgrid(np.arange(-n, n + 1), np.arange(-n, n + 1), indexing="ij")
    c = n - np.abs(a) - np.abs(b)
    upper = np.full(a.shape, -1, np.int32)
    lower = upper.copy()
    upper[c >= 0] = np.arange(np.count_nonzero(c >= 0))
    lower[c > 0] = np.arange(np.count_nonzero(c > 0)) + upper.max() + 1
    lower[c == 0] = upper[c == 0]
    grid = np.concatenate([np.stack([a, b, c], -1)[c >= 0], np.stack([a, b, -c], -1)[c > 0]]).astype(float)
    unit = grid / np.linalg.norm(grid, axis=1, keepdims=True)
    noise = sum(np.sin(f * unit @ np.roll([0.9, 1.7, -1.1], f)) / f for f in (3, 7, 17, 41, 97))
    vertices = ((100 + 3 * noise)[:, None] * unit).astype(np.float32)
    i, j = np.nonzero(np.add.outer(np.arange(n), np.arange(n)) < n)
    inner = i + j < n - 1
    faces = []
    for number, sx, sy in [(number, sx, sy) for number in (upper, lower) for sx in (1, -1) for sy in (1, -1)]:
        at = lambda p, q: number[n + sx * p, n + sy * q]
        both = np.concatenate([np.stack([at(i, j), at(i + 1, j), at(i, j + 1)], -1),
                               np.stack([at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)], -1)[inner]])  # fmt: skip
        order = np.argsort(np.concatenate([2 * (i * n + j), (2 * (i * n + j) + 1)[inner]]), kind="stable")
        faces.append(both[order][:, :: 1 if (sx * sy > 0) == (number is upper) else -1])
    return vertices, np.concatenate(faces).astype(np.int32)


@law([1, 10, 100, 1000, 10**4], [1, 10])
def bodies(n, folder, build):
    """Cubes of one mesh in a ball of 20 m, smaller the more there are, so that they cover the same share of the view."""
    radius_m, cover, rng = 20.0, 0.6, random.Random(n)
    corners = [(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
    quads = [(1, 2, 4, 3), (5, 7, 8, 6), (1, 5, 6, 2), (3, 4, 8, 7), (1, 3, 7, 5), (2, 6, 8, 4)]
    (folder / "cube.obj").write_text("".join("v %d %d %d\n" % c for c in corners) + "".join("f %d %d %d %d\n" % q for q in quads))
    rows = ["t_s,body,x_m,y_m,z_m,qw,qx,qy,qz,vx_m_s,vy_m_s,vz_m_s,wx_rad_s,wy_rad_s,wz_rad_s\n"]
    for i in range(n):
        v, q = ([rng.gauss(0, 1) for _ in range(k)] for k in (3, 4))
        reach = radius_m * rng.random() ** (1 / 3) / math.hypot(*v) if n > 1 else 0.0
        numbers = [reach * x for x in v] + [x / math.hypot(*q) for x in q] + [rng.gauss(0, 0.1) for _ in range(6)]
        rows.append(f"0,c{i}," + ",".join("%.6f" % x for x in numbers) + "\n")
    (folder / "motion.csv").write_text("".join(rows))
    half_m = cover * radius_m / math.sqrt(1.5 * n)  # of a cube, whose mean shadow is 1.5 times a face
    scene = written(folder, SUN + camera(60, 512) + f"""[[body]]
name = "c*"
mesh = "cube.obj"
scale = {half_m}
material = {{kind = "lambert", albedo = 0.5}}
trajectory = "motion.csv"
[[lidar]]
name = "scanner"
position_m = [0, 0, -60]
attitude_wxyz = [0.70710678, 0.70710678, 0, 0]
model = "VLP-16"
range_max_m = 120
""")  # fmt: skip
    return {"scene": scene, "frames": FRAMES, "sweeps": {"LiDAR turn, ms": ({}, max(5, 200 // n))}, "load": True}


@law([1, 4, 16, 64, 256], [1, 4])
def lights(n, folder, build):
    """Square lamps above a floor with balls; together they always send out the same light."""
    side = round(n**0.5)
    places = [(20 * ((k % side + 0.5) / side - 0.5), 20 * ((k // side + 0.5) / side - 0.5)) for k in range(n)]
    (folder / "lamp.obj").write_text("v -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\nf 1 2 3 4\n")
    floor = '[[body]]\nname = "floor"\nmesh = "lamp.obj"\nscale = 12\nposition_m = [0, 0, 8]\n' + "".join(
        f'[[body]]\nname = "b{k}"\nsphere = {{radius_m = 1.5}}\nposition_m = [{5 * (k % 4) - 7.5}, {5 * (k // 4) - 7.5}, 6.5]\n'
        for k in range(16))  # fmt: skip
    rest = floor + camera(22, 256)
    half = 2 / n**0.5
    rectangles = "".join(f'[[light]]\nname = "l{k}"\nkind = "rectangle"\nposition_m = [{x}, {y}, 0]\nsize_m = [{2 * half}, {2 * half}]\n'
                         f'radiance_w_m2_sr = 10\n' for k, (x, y) in enumerate(places))  # fmt: skip
    emitters = "".join(f'[[body]]\nname = "l{k}"\nmesh = "lamp.obj"\nscale = {half}\nposition_m = [{x}, {y}, 0]\n'
                       f'material = {{kind = "lambert", albedo = 0.2, emission = 10.0}}\n' for k, (x, y) in enumerate(places))  # fmt: skip
    (folder / "bodies.toml").write_text(emitters + rest)
    return {"scene": written(folder, rectangles + rest), "frames": FRAMES,
            "others": {"frame, path, lit by bodies, ms": (str(folder / "bodies.toml"), PATH)}}  # fmt: skip


def craft(build, cameras):
    mesh = build.resolve() / "scenes/craft/craft.obj"
    return '[sun]\ndirection = [0.62, -0.48, 0.62]\n' + f'[[body]]\nname = "craft"\nmesh = "{mesh}"\n' + cameras


def craft_camera(pixels, name="nav", aside=0.0):
    return (f'[[camera]]\nname = "{name}"\nposition_m = [{11 + aside}, -4, 15]\nlook_at = [0, 0, 0.6]\nup = [0, 0.8, 0.7]\n'
            f'resolution = [{pixels}, {pixels}]\nfov_horizontal_deg = 27.4\nformat = "GREY"\n')  # fmt: skip


@law([64, 128, 256, 512, 1024, 2048, 4096], [32, 64])
def pixels(n, folder, build):
    """The craft of 200,000 triangles in images of n x n pixels."""
    return {"scene": written(folder, craft(build, craft_camera(n))), "frames": FRAMES, "load": True, "size": n * n}


@law([1, 2, 4, 8, 16], [1, 2])
def cameras(n, folder, build):
    """A frame of each of n cameras of 256 x 256 pixels around the craft."""
    views = "".join(craft_camera(256, f"c{k}", 0.2 * k) for k in range(n))
    return {"scene": written(folder, craft(build, views)), "frames": FRAMES, "load": True}


@law([1, 8, 16, 32, 64], [1, 8])
def sub_rays(n, folder, build):
    """A turn of a VLP-16 with a beam of 3 mrad at the docking station."""
    beam = {"lidar.top.beam_divergence_rad": 0.003, "lidar.top.sub_rays": n}
    return {"scene": "docking", "sweeps": {"turn, ms": (beam, 200)}}


@law([2**k for k in range(20) if 2**k <= (os.cpu_count() or 1)], [1])
def threads(n, folder, build):
    """The craft in 1024 x 1024 pixels."""
    return {"scene": written(folder, craft(build, craft_camera(1024))), "frames": FRAMES, "wall": True, "threads": n}


# --- One size, in a process of its own ---


def resident_mb(key):
    return int(next(row for row in open("/proc/self/status") if row.startswith(key)).split()[1]) / 1e3


def cpu_s():
    return sum(u.ru_utime + u.ru_stime for u in map(resource.getrusage, (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)))


def least_ms(work, clock, least_s, most=15):
    """Least time of some calls, for least_s at least, after a first one."""
    work()
    times = []
    while not times or (len(times) < 3 and sum(times) < 10 * least_s) or (sum(times) < least_s and len(times) < most):
        start = clock()
        work()
        times.append(clock() - start)
    return 1e3 * min(times)


def sweep_s(narpa, scene, keys, turns):
    """CPU time of `narpa scan` for so many turns of the first LiDAR, to packets."""
    sets = [text for key, value in keys.items() for text in ("--set", f"{key}={value}")]
    command = [narpa, "scan", scene, "--duration", str(0.1 * turns), "-o", "/dev/shm/narpa-cost-laws.pcap", *sets]
    start = cpu_s()
    subprocess.run(command, check=True, capture_output=True)
    return cpu_s() - start


def costs(about, program):
    import narpa

    def load(scene, keys):
        return narpa.load_scene(scene, keys, threads=about.get("threads", 1))

    def render_all(scene):
        for name in scene.cameras:
            scene.render(name)

    found, before_mb, start_s = {}, resident_mb("VmRSS"), cpu_s()
    first = load(about["scene"], DIRECT)
    if about.get("load"):
        found["load, s"] = cpu_s() - start_s
        render_all(first)
        found["memory, MB"] = resident_mb("VmHWM") - before_mb
    del first
    frames = {name: (about["scene"], keys) for name, keys in about.get("frames", {}).items()} | about.get("others", {})
    for name, (scene, keys) in frames.items():
        made = load(scene, keys)
        found[name] = least_ms(lambda: render_all(made), time.process_time, about["least_s"])
        if about.get("wall"):
            found[name.replace(", ms", ", wall ms")] = least_ms(lambda: render_all(made), time.perf_counter, about["least_s"])
    for name, (keys, turns) in about.get("sweeps", {}).items():
        least = [min(sweep_s(program, about["scene"], keys, n) for _ in range(3)) for n in (1, 1 + turns)]
        found[name] = 1e3 * (least[1] - least[0]) / turns
    return found


# --- Tables and the picture ---


def exponents(rows):
    """Of each cost, over the last tenfold of the sizes."""
    last = rows[-1]
    first = max((r for r in rows[:-1] if r["size"] * 9.9 <= last["size"]), key=lambda r: r["size"], default=rows[0])
    grown = math.log(last["size"] / first["size"])
    return {key: math.log(max(last[key], 1e-9) / max(first[key], 1e-9)) / grown for key in last if key not in ("size", "n")}


def measure(name, options):
    sizes, quick, function = LAWS[name]
    rows = []
    for n in quick if options.quick else sizes:
        with tempfile.TemporaryDirectory() as folder:
            about = function(n, Path(folder), options.build) | {"least_s": 0 if options.quick else 1}
            command = [sys.executable, __file__, "--build", options.build, "--point", json.dumps(about)]
            done = subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True)
        row = {"n": n, "size": about.get("size", n)} | json.loads(done.stdout.splitlines()[-1])
        keys = [key for key in row if key not in ("n", "size")]
        if not rows:
            print(f"\n{function.__doc__}\n\n| {name} | {' | '.join(keys)} |\n|{'---|' * (len(keys) + 1)}")
        print(f"| {n:,} | {' | '.join(f'{row[key]:.3g}' for key in keys)} |", flush=True)
        rows.append(row)
    if len(rows) > 1:
        found = exponents(rows)
        print(f"| exponent | {' | '.join(f'{found[key]:.2f}' for key in keys)} |", flush=True)
    return rows


def plot(path, laws):
    from narpa.plots import style

    with style.context():
        looks = {"load": (style.GREY, "o-"), "memory": (style.PURPLE, "s--"), "frame, direct": (style.BLUE, "o-"),
                 "frame, path": (style.VERMILION, "o-"), "frame, path, lit by bodies": (style.GREEN, "o-")}  # fmt: skip
        columns = 4
        figure = style.figure(3.5 * columns, 3.1 * -(-len(laws) // columns))
        grid = figure.subplots(-(-len(laws) // columns), columns, squeeze=False)
        for axes in grid.flat[len(laws):]:
            axes.set_axis_off()
        for axes, (name, rows) in zip(grid.flat, laws.items()):
            found = exponents(rows) if len(rows) > 1 else {}
            for key in (key for key in rows[0] if key not in ("n", "size")):
                short, unit = key.rsplit(", ", 1)
                colour, marks = looks.get(short.removesuffix(", wall"), (style.ORANGE, "o-"))
                costs = [(1e3 if unit == "s" else 1) * r[key] for r in rows]
                axes.plot([r["size"] for r in rows], costs, "o:" if unit == "wall ms" else marks, color=colour, markersize=3.5,
                          label=key.removesuffix(" ms").removesuffix(", MB").rstrip(",").removesuffix(", s")
                          + (f": {found[key]:.2f}" if found else ""))  # fmt: skip
            style.logarithmic(axes)
            axes.set(title=name, ylabel="ms (memory: MB)" if "memory, MB" in rows[0] else "ms")
            axes.legend()
        figure.savefig(path)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("laws", nargs="*", metavar="LAW", help=f"some of {', '.join(LAWS)} (default: all)")
    parser.add_argument("--quick", action="store_true", help="small sizes, to see that it works")
    parser.add_argument("--json", type=Path)
    parser.add_argument("--plot", type=Path)
    parser.add_argument("--build", type=Path, default=ROOT / "build/release", help="where narpa was built")
    parser.add_argument("--point", help=argparse.SUPPRESS)
    options = parser.parse_args()
    sys.path.insert(0, str(options.build / "python"))
    if options.point:
        print(json.dumps(costs(json.loads(options.point), options.build / "bin/narpa")))
        return
    unknown = set(options.laws) - set(LAWS)
    if unknown:
        parser.error(f"unknown {', '.join(sorted(unknown))}; expected some of {', '.join(LAWS)}")
    laws = {name: measure(name, options) for name in options.laws or LAWS}
    if options.json:
        options.json.write_text(json.dumps(laws, indent=1) + "\n")
    if options.plot:
        plot(options.plot, laws)


if __name__ == "__main__":
    main()
