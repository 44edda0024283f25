#!/usr/bin/python3
"""Time and memory to load a mesh, against its number of triangles.

Usage: bench/mesh_load.py [--program NARPA]... [--threads N] [--format ply|stl|obj] [--rounds N] [TRIANGLES...]

Writes spheres with noise of about so many triangles (default 1e4 1e5 1e6 1e7 1.6e7) as binary PLY, binary STL or OBJ into a
temporary folder, and renders a frame of 64 x 64 pixels of each. With several --program they take turns. Prints the least of the
rounds: wall time and CPU time of the command, without those of a sphere of 8 triangles, and the largest resident memory of one of its
processes.
"""
import argparse
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

SCENE = """[scene]
name = "mesh"
[sun]
direction = [0.6, -0.5, 0.6]
irradiance_w_m2 = 1361.0
[[body]]
name = "body"
mesh = "{mesh}"
[[camera]]
name = "nav"
position_m = [400.0, 0.0, 0.0]
look_at = [0.0, 0.0, 0.0]
resolution = [64, 64]
fov_horizontal_deg = 40.0
rate_hz = 1.0
format = "GREY"
[camera.detector]
exposure_s = 1e-3
f_number = 8.0
pixel_pitch_m = 5.5e-6
quantum_efficiency = 0.6
full_well_e = 13500
bits = 12
[render]
method = "direct"
spp = 1
seed = 1
"""


def sphere(triangles):
    """Vertices (float32, about 100 m from the middle) and faces (int32) of an octahedron whose faces are cut into n^2 each."""
    n = max(1, round((triangles / 8) ** 0.5))
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
    faces = []
    for up, sx, sy in [(up, sx, sy) for up in (True, False) for sx in (1, -1) for sy in (1, -1)]:
        number = upper if up else lower
        i, j = np.nonzero(np.add.outer(np.arange(n), np.arange(n)) < n)

        def at(p, q, number=number, sx=sx, sy=sy):
            return number[n + sx * p, n + sy * q]

        inner = i + j < n - 1
        both = np.concatenate([
            np.stack([at(i, j), at(i + 1, j), at(i, j + 1)], -1),
            np.stack([at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)], -1)[inner]])  # fmt: skip
        order = np.argsort(np.concatenate([2 * (i * n + j), (2 * (i * n + j) + 1)[inner]]), kind="stable")
        faces.append(both[order][:, :: 1 if (sx * sy > 0) == up else -1])
    return vertices, np.concatenate(faces).astype(np.int32)


def write_mesh(path, vertices, faces):
    if path.suffix == ".ply":
        head = (f"ply\nformat binary_little_endian 1.0\nelement vertex {len(vertices)}\nproperty float x\nproperty float y\n"
                f"property float z\nelement face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n")  # fmt: skip
        rows = np.empty(len(faces), np.dtype([("count", "u1"), ("corners", "<i4", 3)]))
        rows["count"], rows["corners"] = 3, faces
        path.write_bytes(head.encode() + vertices.tobytes() + rows.tobytes())
    elif path.suffix == ".stl":
        rows = np.zeros(len(faces), np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")]))
        rows["corners"] = vertices[faces]
        path.write_bytes(bytes(80) + np.uint32(len(faces)).tobytes() + rows.tobytes())
    else:
        with path.open("w") as out:
            for lines, rows in (("v %.9g %.9g %.9g\n", vertices), ("f %d %d %d\n", faces + 1)):
                for part in np.array_split(rows, len(rows) // 100_000 + 1):
                    out.write(lines * len(part) % tuple(part.ravel().tolist()))


def render(program, scene, threads):
    """Wall time, CPU time (both s) and memory (MB) of a frame."""
    begin = time.perf_counter()
    process = subprocess.Popen([program, "render", scene, "--threads", str(threads), "-o", "/dev/shm/narpa-mesh-load.png"],
                               stdout=subprocess.DEVNULL)  # fmt: skip
    _, status, used = os.wait4(process.pid, 0)
    if status:
        sys.exit(f"{program} render {scene}: status {status}")
    return time.perf_counter() - begin, used.ru_utime + used.ru_stime, used.ru_maxrss / 1e3


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("--program", action="append", type=Path)
    parser.add_argument("--threads", type=int, default=0, help="0: all")
    parser.add_argument("--format", default="ply", choices=["ply", "stl", "obj"])
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("triangles", nargs="*", type=float, default=[1e4, 1e5, 1e6, 1e7, 1.6e7])
    args = parser.parse_args()
    programs = args.program or [Path(__file__).parents[1] / "build/release/bin/narpa"]
    base = {}
    with tempfile.TemporaryDirectory() as folder:
        for count in [8, *args.triangles]:
            mesh = Path(folder) / f"mesh.{args.format}"
            scene = Path(folder) / "mesh.toml"
            scene.write_text(SCENE.format(mesh=mesh.name))
            vertices, faces = sphere(count)
            write_mesh(mesh, vertices, faces)
            triangles = len(faces)
            del vertices, faces
            rounds = [[render(p, scene, args.threads) for p in programs] for _ in range(args.rounds)]
            for program, runs in zip(programs, zip(*rounds)):
                wall, cpu, memory = (min(values) for values in zip(*runs))
                empty = base.setdefault(program, (wall, cpu))
                if count != 8:
                    print(f"{program}: {triangles} triangles, {mesh.stat().st_size / 1e6:.0f} MB: {wall - empty[0]:.2f} s, "
                          f"{cpu - empty[1]:.2f} s of CPU, {memory:.0f} MB")  # fmt: skip


if __name__ == "__main__":
    main()
