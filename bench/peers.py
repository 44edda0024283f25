#!/usr/bin/python3
"""narpa beside Cycles (Blender) and POV-Ray: error against time on the same scenes.

Usage: bench/peers.py [--scenes LIST] [--size PIXELS] [--threads N] [--rounds N] [--quick] [--json FILE] [--plot FILE.png]
                      [--build FOLDER]

Scenes: craft, craft-and-ball (direct sunlight), craft-and-ball-paths (four bounces), cornell (a lamp, seven bounces); and two on which
no parameter of narpa was tuned: rubble (a small body with boulders, four bounces), module (inside a station, eight lamps, seven
bounces). All surfaces are Lambert's; all programs render the same triangles on the same number of threads of the CPU. POV-Ray, which
has no path tracing, renders the scenes with direct light.

Each program's frames are compared with its own reference of many samples, whose noise is subtracted, and the references with each
other. RMSE is of all pixels and bands, in percent of the image's mean. Programs take turns; times are medians. "x" is the time of the
other program for its row's error, divided by narpa's for the same error (interpolated linearly in log time and log error).

Exit status: 1 where two references differ by more than 1 % in the mean, 77 without Blender and POV-Ray.
"""
import argparse
import contextlib
import json
import math
import statistics
import sys
import tempfile
from pathlib import Path

import numpy as np

from beside import renderers, scenes

ROOT = Path(__file__).resolve().parents[1]
AGREE = 0.01  # of the mean
SPP, RAYS, GRID = [1, 2, 4, 8, 16, 32, 64], [2, 4, 8, 16, 32, 64, 128], [1, 2, 3, 4]
# Of each program: its ladders, and its reference as so many images of one rung.
LADDERS = {"narpa": ([("spp", n) for n in [*SPP, 128]] + [("rays", n) for n in RAYS], (8, ("spp", 128))),
           "Cycles": ([("spp", n) for n in SPP], (8, ("spp", 64))),
           "POV-Ray": ([("grid", n) for n in GRID], (1, ("grid", 10)))}  # fmt: skip
QUICK = {"narpa": ([("spp", 2), ("spp", 8), ("rays", 4), ("rays", 32)], (4, ("spp", 32))),
         "Cycles": ([("spp", 2), ("spp", 8)], (4, ("spp", 32))),
         "POV-Ray": ([("grid", 1), ("grid", 2)], (1, ("grid", 4)))}  # fmt: skip
LABELS = {"spp": "{} spp", "rays": "{} rays/px", "grid": "{0} x {0}"}


def reference(renderer, images, rung):
    """Mean image, and the noise variance that is left in it."""
    frames = np.array([renderer.render(rung, 1000 + k)[0] for k in range(images)])
    return frames.mean(axis=0), (frames.var(axis=0, ddof=1).mean() / images if images > 1 else 0.0)


def smooth_pixels(image):
    """Those whose neighbours differ little from them: no edges of surfaces or shadows."""
    level = image.mean(axis=2)
    shifted = [np.roll(level, (i, j), (0, 1)) for i in (-1, 0, 1) for j in (-1, 0, 1)]
    return (level > 0) & (np.ptp(shifted, axis=0) < 0.1 * level)


def disagreement(ours, theirs):
    """Differences of two references, in percent: of the mean, and of the mean over smooth pixels."""
    smooth = smooth_pixels(ours)
    return [100 * (theirs[where].mean() / ours[where].mean() - 1) if where.any() else math.nan for where in (smooth | True, smooth)]


def measure(scene, programs, ladders, options, folder):
    """Rows of one scene, and the differences of its references."""
    with contextlib.ExitStack() as stack:
        pixels = options.size // scene.shrink
        used = [stack.enter_context(p(scene, pixels, options.threads, folder)) for p in programs]
        references = {r.name: reference(r, *ladders[r.name][1]) for r in used}
        rows = [{"scene": scene.name, "program": r.name, "rung": rung, "runs": []} for r in used for rung in ladders[r.name][0]]
        by_name = {r.name: r for r in used}
        for k in range(options.rounds):
            for row in sorted(rows, key=lambda row: row["rung"][1]):  # so that the programs take turns
                row["runs"].append(by_name[row["program"]].render(row["rung"], k))
    ours = references["narpa"][0]
    for row in rows:
        image, noise = references[row["program"]]
        runs = row.pop("runs")
        row["wall_s"], row["cpu_s"] = (statistics.median(r[i] for r in runs) for i in (1, 2))
        square = statistics.mean(((r[0] - image) ** 2).mean() for r in runs)
        row["rmse_percent"] = 100 * math.sqrt(max(square - noise, 0)) / image.mean()
    return rows, {name: disagreement(ours, image) for name, (image, _) in references.items() if name != "narpa"}


def time_at(rows, error, key):
    """Time of a ladder for an error, of its rungs that no cheaper one beats; None outside of their errors."""
    points = sorted((r["rmse_percent"], r[key]) for r in rows
                    if not any(s[key] <= r[key] and s["rmse_percent"] < r["rmse_percent"] for s in rows))  # fmt: skip
    for (e0, t0), (e1, t1) in zip(points, points[1:]):
        if e0 <= error <= e1:
            share = math.log(error / e0) / math.log(e1 / e0)
            return math.exp(math.log(t0) + share * math.log(t1 / t0))
    return None


def add_ratios(rows):
    narpa = {kind: [r for r in rows if r["program"] == "narpa" and r["rung"][0] == kind] for kind in ("spp", "rays")}
    for row in rows:
        if row["program"] != "narpa":
            for kind, ladder in narpa.items():
                for key in ("cpu_s", "wall_s"):
                    ours = time_at(ladder, row["rmse_percent"], key)
                    row[f"{kind}_{key}_ratio"] = ours and row[key] / ours


def print_table(rows):
    print("| program | samples | RMSE, % | CPU ms | wall ms | x, spp | x, rays |\n|" + "---|" * 7)
    for row in rows:
        ratios = [row.get(f"{kind}_cpu_s_ratio") for kind in ("spp", "rays")]
        texts = ["" if row["program"] == "narpa" else f"{r:.1f}" if r else "-" for r in ratios]
        print(f"| {row['program']} | {LABELS[row['rung'][0]].format(row['rung'][1])} | {row['rmse_percent']:.3g} | "
              f"{1e3 * row['cpu_s']:.0f} | {1e3 * row['wall_s']:.0f} | {' | '.join(texts)} |", flush=True)  # fmt: skip


def plot(path, all_rows):
    from narpa.plots import style

    series = {("narpa", "spp"): (style.BLUE, "o-"), ("narpa", "rays"): (style.BLUE, "s--"), ("Cycles", "spp"): (style.VERMILION, "^-"),
              ("POV-Ray", "grid"): (style.GREEN, "v-")}  # fmt: skip
    names = list(dict.fromkeys(r["scene"] for r in all_rows))
    columns = min(3, len(names))
    lines = -(-len(names) // columns)
    with style.context():
        figure = style.figure(4.2 * columns, 3.4 * lines)
        grid = list(figure.subplots(lines, columns, squeeze=False).flat)
        for name, axes in zip(names, grid):
            for (program, kind), (colour, marks) in series.items():
                rows = [r for r in all_rows if (r["scene"], r["program"], r["rung"][0]) == (name, program, kind)]
                label = f"{program}, budgets in rays" if kind == "rays" else program
                if rows:
                    axes.plot([1e3 * r["cpu_s"] for r in rows], [r["rmse_percent"] for r in rows], marks, color=colour, markersize=4,
                              label=label)  # fmt: skip
            style.logarithmic(axes)
            axes.set(title=name, xlabel="CPU ms a frame", ylabel="RMSE, % of the mean")
        grid[0].legend()
        for axes in grid[len(names):]:
            axes.set_axis_off()
        figure.savefig(path)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scenes", default=",".join(scenes.SCENES))
    parser.add_argument("--size", type=int, default=256, help="pixels of a side; half of it in cornell and module")
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--quick", action="store_true", help="tiny images and few samples, to see that it works")
    parser.add_argument("--json", type=Path)
    parser.add_argument("--plot", type=Path)
    parser.add_argument("--build", type=Path, default=ROOT / "build/release", help="where narpa was built")
    options = parser.parse_args()
    missing = {p: p.missing() for p in (renderers.Cycles, renderers.PovRay)}
    for why in filter(None, missing.values()):
        print(f"skipped: {why}", file=sys.stderr)
    if all(missing.values()):
        sys.exit(77)
    sys.path.insert(0, str(options.build / "python"))
    ladders = QUICK if options.quick else LADDERS
    if options.quick:
        options.size, options.rounds = 32, 2
    all_rows, agreements = [], {}
    for name in options.scenes.split(","):
        scene = scenes.load(name, options.build / "scenes")
        programs = [renderers.Narpa, *(p for p, why in missing.items() if not why and (p is renderers.Cycles or scene.depth == 1))]
        with tempfile.TemporaryDirectory() as folder:
            rows, agreements[name] = measure(scene, programs, ladders, options, Path(folder))
        add_ratios(rows)
        differences = "; ".join(f"{program}'s mean differs by {whole:+.2f} %, away from edges {smooth:+.2f} %"
                                for program, (whole, smooth) in agreements[name].items())  # fmt: skip
        print(f"\n{name}{'' if scene.tuned else ' (never tuned on)'}: {differences}\n", flush=True)
        print_table(rows)
        all_rows += rows
        if options.json:
            options.json.write_text(json.dumps({"rows": all_rows, "mean_difference_percent": agreements, "size": options.size,
                                                "threads": options.threads}, indent=1) + "\n")  # fmt: skip
    if options.plot:
        plot(options.plot, all_rows)
    limit = 100 * (10 if options.quick else 1) * AGREE
    sys.exit(any(abs(d[0]) > limit for found in agreements.values() for d in found.values()))


if __name__ == "__main__":
    main()
