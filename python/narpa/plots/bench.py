"""Plots of `narpa bench render` and `narpa bench loop`."""
import math

import numpy as np
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from narpa.plots.style import BLUE, CYCLE, GREY, ORANGE, SKY, VERMILION, GREEN, PURPLE, figure, logarithmic, number


def convergence(document):
    """Error over samples per pixel and over time. The grey lines have slope -1/2, the convergence of independent samples."""
    drawn = figure(11, 5, document["title"])
    panels = drawn.subplots(1, 2)
    errors = (("rmse", "slope", "of the mean radiance", document["reference"]["mean"], BLUE),
              ("relative_rmse", "relative_slope", "of each pixel", 1, VERMILION))  # fmt: skip
    for axes, x, x_name in zip(panels, ("spp", "render_s"), ("samples per pixel", "seconds per frame")):
        for key, slope, name, whole, colour in errors:
            rows = [row for row in document["rows"] if number(row[key]["value"]) > 0]
            if not rows:
                continue
            xs = np.array([row[x] for row in rows], float)
            ys = np.array([row[key]["value"] for row in rows]) * 100 / whole
            bars = np.minimum(np.array([number(row[key]["standard_error"]) for row in rows]) * 100 / whole, 0.9 * ys)
            fit = document[slope]
            label = f"{name}: slope {fit['value']:.3f} ± {fit['standard_error']:.3f}" if x == "spp" else name
            axes.errorbar(xs, ys, bars, fmt="o-", color=colour, markersize=4, label=label)
            axes.plot(xs, ys[0] * np.sqrt(xs[0] / xs), color=GREY, linewidth=0.8)
        logarithmic(axes)
        axes.set_xlabel(x_name)
        axes.set_ylabel("RMS error, %")
        axes.plot([], [], color=GREY, linewidth=0.8, label="slope -1/2")
        axes.legend()
    return drawn


KINDS_OF_RUNGS = (("plain loop, fixed spp", GREY, True, False), ("narpa, fixed spp", BLUE, False, False),
                  ("narpa, budget in rays/px", VERMILION, False, True))  # fmt: skip
PHASE_COLOURS = ("#bebe78", BLUE, GREEN, PURPLE, VERMILION, "#aaaaaa", ORANGE, SKY)
COMPLETE_STEPS = ("refined", "one_sample")  # steps that render the complete frame


def ladder(document):
    """For each scene: error over time, and below it the phases of each budget's render time."""
    scenes = document["scenes"]
    columns = min(3, max(1, len(scenes)))
    rows = math.ceil(len(scenes) / columns)
    drawn = figure(5.4 * columns + 0.4, 6.6 * rows + 0.9, document["title"])
    grid = drawn.add_gridspec(1 + 2 * rows, columns, height_ratios=[0.3] + [3, 2] * rows)
    parts = []
    for k, scene in enumerate(scenes):
        row, at = 1 + 2 * (k // columns), k % columns
        ladder_errors(drawn.add_subplot(grid[row, at]), scene)
        parts = ladder_bars(drawn.add_subplot(grid[row + 1, at]), scene) or parts
    marks = [Line2D([], [], color=colour, marker="o", markersize=4, label=name) for name, colour, _, _ in KINDS_OF_RUNGS]
    marks.append(Line2D([], [], color=VERMILION, linewidth=0.8, label="predicted by the frames"))
    marks.append(Line2D([], [], color=VERMILION, marker="o", markerfacecolor="white", linestyle="", label="light left out"))
    marks += [Patch(color=PHASE_COLOURS[i % len(PHASE_COLOURS)], label=name) for i, name in enumerate(parts)]
    header = drawn.add_subplot(grid[0, :])
    header.set_axis_off()
    header.legend(handles=marks, loc="center", ncol=2 * columns)
    return drawn


def ladder_errors(axes, scene):
    level = scene["reference"]["mean"]
    for _, colour, loop, adaptive in KINDS_OF_RUNGS:
        rungs = [r for r in scene["rungs"] if r["loop"] == loop and r["adaptive"] == adaptive and number(r["rmse"]["value"]) > 0]
        ms = [1e3 * r["median_s"] for r in rungs]
        errors = [100 * r["rmse"]["value"] / level for r in rungs]
        predicted = [100 * (r.get("predicted") or math.nan) / level for r in rungs]
        axes.plot(ms, errors, "o-", color=colour, markersize=4)
        axes.plot(ms, predicted, color=colour, linewidth=0.8)
        for r, x, y in zip(rungs, ms, errors):
            if r.get("step", "refined") not in COMPLETE_STEPS:
                axes.plot(x, y, "o", color=colour, markerfacecolor="white", markersize=5)
            digits = next((word for word in r["name"].split() if word.replace(".", "").isdigit()), "")
            axes.annotate(digits, (x, y), xytext=(-4, -11) if adaptive else (3, 4), textcoords="offset points",
                          color=colour, fontsize=7, ha="right" if adaptive else "left")  # fmt: skip
    if axes.lines:
        logarithmic(axes)
    axes.set_title(f"{scene['scene']}, {scene['width']} x {scene['height']}")
    axes.set_xlabel("ms per frame")
    axes.set_ylabel("RMSE, %")
    for k, (key, name) in enumerate((("rays", "budgets in rays"), ("spp", "fixed spp"))):
        gain = scene.get("speed_up", {}).get(key)
        if gain:
            axes.text(0.02, 0.03 + 0.06 * k, f"{name}: {gain['median']:.2f} times as fast as the loop",
                      transform=axes.transAxes, fontsize=7.5, color=(VERMILION, BLUE)[k])  # fmt: skip


def ladder_bars(axes, scene):
    """The share of each phase in the frame's time; returns the names of the phases."""
    rungs = [r for r in scene["rungs"] if not r["loop"]]
    names = []
    for y, r in enumerate(rungs):
        phases = dict(r.get("phase_s", {}))
        timed, frame_s = sum(phases.values()), r["median_s"] + scene["detector_s"]
        start = 0
        if timed > 0:
            shares = {k.replace("_", " "): v / timed * r["median_s"] / frame_s for k, v in phases.items()}
            shares["detector and conversion"] = scene["detector_s"] / frame_s
            names = list(shares)
            for i, share in enumerate(shares.values()):
                axes.barh(y, 100 * share, left=start, color=PHASE_COLOURS[i % len(PHASE_COLOURS)])
                start += 100 * share
        axes.text(101, y, f"{1e3 * frame_s:.3g} ms", va="center", fontsize=7)
    axes.set_yticks(range(len(rungs)), [r["name"] for r in rungs], fontsize=7)
    axes.invert_yaxis()
    axes.set_xlim(0, 100)
    axes.set_xlabel("% of the frame's time")
    axes.grid(False)
    return names


LOOP_PANELS = (("wake_late_ms", "wake-up latency, ms", True), ("hand_over_ms", "mid-exposure to hand-over, ms", True),
               ("late_ms", "hand-over after the deadline, ms (negative: before)", False))  # fmt: skip


def loop(document):
    """For each camera: the share of frames that exceed a time, over the time, with and without load."""
    runs = document["runs"]
    cameras = runs[0]["cameras"] if runs else []
    drawn = figure(13, 3.9 * max(1, len(cameras)) + 0.5, document["title"])
    grid = drawn.subplots(max(1, len(cameras)), 3, squeeze=False)
    for c, camera in enumerate(cameras):
        for axes, (key, name, log_x) in zip(grid[c], LOOP_PANELS):
            for run, colour in zip(runs, CYCLE):
                points = np.array(run["cameras"][c][key], float).reshape(-1, 2)
                axes.step(points[:, 0], 100 * points[:, 1], where="pre", color=colour, label=run["name"])
                axes.plot(points[-1:, 0], 100 * points[-1:, 1], "o", color=colour, markersize=4)
            logarithmic(axes, "xy" if log_x else "y")
            if not log_x:
                axes.axvline(0, color=GREY)
            axes.set_title(f"{camera['name']}: {name}")
            axes.set_ylabel("frames that exceed it, %")
            axes.legend()
    return drawn


KINDS = {"convergence": convergence, "ladder": ladder, "loop": loop}
