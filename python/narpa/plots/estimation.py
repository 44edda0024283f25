"""Plots of `narpa estimate` and `narpa bench estimate`."""
import math

import numpy as np

from narpa.plots.style import BLUE, CYCLE, GREEN, GREY, INK, ORANGE, SKY, VERMILION
from narpa.plots.style import column, figure, image, logarithmic, positive, show_image

QUANTITIES = (("rotation", "rad", "attitude error, deg", math.degrees(1)), ("position", "m", "position error, m", 1))
RESIDUALS = (("camera", BLUE, "frames, px"), ("lidar", VERMILION, "sweeps, m"), ("brightness", GREEN, "brightness, part"))


def estimates(document):
    """Errors of every frame over time, with three standard deviations and the Cramer-Rao bound."""
    frames = document["frames"]
    drawn = figure(11, 8, document["title"])
    t = column(frames, "t_s")
    for axes, (quantity, unit, name, scale) in zip(drawn.subplots(2, 1, sharex=True), QUANTITIES):
        values = lambda key: positive(scale * column(frames, f"{quantity}_{key}_{unit}"))
        axes.plot(t, 3 * values("sigma"), color=SKY, linewidth=2, label="3 sigma")
        axes.plot(t, values("bound"), color=VERMILION, linewidth=1, label="bound")
        axes.plot(t, values("filtered"), color=GREEN, linewidth=1.2, label="filtered")
        axes.plot(t, values("error"), "o", color=BLUE, markersize=3, label="a frame alone")
        logarithmic(axes, "y")
        axes.set_ylabel(name)
        axes.legend(ncol=4, loc="lower left", bbox_to_anchor=(0, 1))
    axes.set_xlabel("simulation time, s")
    return drawn


def batch(document):
    """Errors of the trajectory, residuals before and after, and errors of the model with their priors."""
    drawn = figure(11, 12, document["title"])
    *errors, residuals, unknowns = drawn.subplots(4, 1, gridspec_kw={"height_ratios": [2, 2, 2, 3]})
    t = column(document["states"], "t_s")
    for axes, (quantity, unit, name, scale) in zip(errors, QUANTITIES):
        values = lambda key: positive(scale * column(document["states"], f"{quantity}_{key}_{unit}"))
        axes.plot(t, 3 * values("sigma"), color=SKY, linewidth=2, label="3 sigma")
        axes.plot(t, values("error"), "o-", color=BLUE, markersize=3, linewidth=1, label="error")
        logarithmic(axes, "y")
        axes.set_ylabel(name)
        axes.legend(ncol=2, loc="lower left", bbox_to_anchor=(0, 1))
    for measure, colour, name in RESIDUALS:
        rows = [r for r in document["residuals"] if r["measure"] == measure]
        if not rows:
            continue
        residuals.plot(column(rows, "t_s"), positive(column(rows, "start")), ":", color=colour, label=f"{name}, about own pose")
        residuals.plot(column(rows, "t_s"), positive(column(rows, "end")), color=colour, label=f"{name}, solution")
    logarithmic(residuals, "y")
    residuals.set_ylabel("RMS residual")
    residuals.set_xlabel("simulation time, s")
    residuals.legend(ncol=3, loc="lower left", bbox_to_anchor=(0, 1))
    rows = document["unknowns"]
    unknowns.axhspan(-1, 1, color=GREEN, alpha=0.15, label="prior")
    for i, row in enumerate(rows):
        colour = BLUE if row["determined"] else GREY
        prior = row["prior_sigma"]
        unknowns.errorbar(i, row["change"] / prior, 3 * row["sigma"] / prior, fmt="o", color=colour, markersize=4)
        unknowns.plot(i, row["truth"] / prior, "_", color=VERMILION, markersize=14)
    unknowns.set_xticks(range(len(rows)), [row["name"] for row in rows], rotation=40, ha="right", fontsize=8)
    unknowns.set_ylabel("change, prior sigmas (bars: 3 sigma;\nred: truth; grey: not determined)")
    return drawn


def calibration(document):
    """Residuals of a camera's calibration: over the image, each by itself, and of each image."""
    drawn = figure(11, 6.2, document["title"])
    grid = drawn.add_gridspec(2, 2, width_ratios=[1.7, 1], height_ratios=[1, 1])
    over_image, single, images = (drawn.add_subplot(place) for place in (grid[:, 0], grid[0, 1], grid[1, 1]))
    u, v, du, dv = np.array(document["points"], float).reshape(-1, 4).T
    enlarged = 0.05 * document["width"] / max(document["rms_px"], 1e-9) / 2
    over_image.quiver(u, v, du, dv, color=BLUE, angles="xy", scale_units="xy", scale=1 / enlarged, width=0.0015)
    over_image.set_xlim(0, document["width"])
    over_image.set_ylim(document["height"], 0)
    over_image.set_aspect("equal")
    over_image.set_title(f"measured minus predicted, {enlarged:.0f} times enlarged", fontsize=9)
    over_image.set_xlabel("px")
    most = 1.1 * np.percentile(np.hypot(du, dv), 99) if len(du) else 1
    single.plot(du, dv, ".", color=BLUE, markersize=2)
    single.set_xlim(-most, most)
    single.set_ylim(-most, most)
    single.set_aspect("equal")
    single.set_title(f"RMS {document['rms_px']:.3f} px (1 % lie outside)", fontsize=9)
    single.set_xlabel("right, px")
    single.set_ylabel("down, px")
    rows = document["images"]
    images.bar(range(len(rows)), column(rows, "rms_px"), color=SKY)
    images.set_xticks(range(len(rows)), [row["image"] for row in rows], rotation=60, ha="right", fontsize=7)
    images.set_ylabel("RMS, px")
    return drawn


def approach(document):
    """Errors and bounds over range, and the convergence basin: share of poses found over the error of the start."""
    drawn = figure(9.5, 10.5, document["title"])
    *panels, basin = drawn.subplots(3, 1, gridspec_kw={"height_ratios": [3, 3, 2.4]})
    for axes, (quantity, unit, name, scale) in zip(panels, QUANTITIES):
        for run, colour in zip(document["runs"], CYCLE):
            found = [f for f in run["frames"] if f["found"]]
            lost = [f["range_m"] for f in run["frames"] if not f["found"]]
            r = column(found, "range_m")
            axes.plot(r, positive(scale * column(found, f"bound_{quantity}_{unit}")), color=colour, linewidth=0.8, alpha=0.6)
            axes.plot(r, positive(scale * column(found, f"{quantity}_{unit}")), "o", color=colour, markersize=3, label=run["method"])
            axes.plot(lost, np.full(len(lost), 0.98), "|", color=colour, transform=axes.get_xaxis_transform())
        logarithmic(axes)
        axes.set_xlabel("range, m (lines: Cramer-Rao bound; ticks at the top: not found)")
        axes.set_ylabel(name)
        axes.legend()
    for run, colour in zip(document["runs"], CYCLE):
        off = [cell["off_deg_and_percent"] for cell in run["basin"]]
        basin.plot(off, [100 * c["found"] / max(1, c["trials"]) for c in run["basin"]], "o-", color=colour, label=run["method"])
    basin.set_visible(any(run["basin"] for run in document["runs"]))
    basin.set_ylim(-5, 105)
    basin.set_xlabel("error of the start, degrees and % of the range")
    basin.set_ylabel("poses found, %")
    return drawn


def approach_frames(document):
    """Frames of the approach, renders at the estimated poses, and the distance of the matches over the solutions."""
    frames = document["frames"]
    drawn = figure(3 * len(frames), 7.2)
    for column_of_panels, frame in zip(np.transpose(drawn.subplots(3, len(frames), squeeze=False)), frames):
        seen, rendered, costs = column_of_panels
        title = f"{frame['range_m']:.1f} m: {frame['rotation_deg']:.4f} deg, {frame['position_m']:.2g} m off"
        show_image(seen, image(frame["image"]), title, cmap="gray", vmin=0, vmax=255)
        show_image(rendered, image(frame["render"]), "render at the estimated pose", cmap="gray", vmin=0, vmax=255)
        squared = positive([distance**2 for pair in frame["matches_px"] for distance in pair])
        costs.plot(np.arange(len(squared)) / 2, squared, "o-", color=BLUE, markersize=4, linewidth=1)
        if np.isfinite(squared).any():
            logarithmic(costs, "y")
        costs.set_title("distance of matches, mean px²")
        costs.set_xlabel("render (before and after each solution)")
    return drawn


def boxes(axes, points, unit):
    """Box plots for x, y and z and both ways of matching: whiskers to 1.5 interquartile ranges (Tukey 1977), outliers."""
    for name, colour, shift in (("whole_pixels", VERMILION, -0.2), ("between_pixels", BLUE, 0.2)):
        errors = np.abs([p[f"{name}_error_m"] for p in points])
        if unit == "%":
            errors = 100 * errors / np.linalg.norm([p["truth_m"] for p in points], axis=1)[:, None]
        line = {"color": colour}
        axes.boxplot(errors, positions=np.arange(3) + shift, widths=0.32, boxprops=line, whiskerprops=line, capprops=line,
                     medianprops={**line, "linewidth": 2}, flierprops={"marker": "+", "markeredgecolor": colour})  # fmt: skip
        axes.plot([], [], color=colour, label=name.replace("_", " "))
    # Errors far below the quartiles are not informative and would stretch the axis.
    quartiles = [np.percentile(np.abs([p["between_pixels_error_m"] for p in points]), 25, axis=0).min()]
    if unit != "%" and quartiles[0] > 0:
        axes.set_ylim(bottom=0.05 * quartiles[0])
    logarithmic(axes, "y")
    axes.set_xticks(range(3), "xyz")
    axes.set_ylabel(f"absolute error, {unit}" if unit == "m" else "error over range, %")
    axes.legend()


def comparison(document):
    """A frame, the render scaled to its brightness, and the residual: red where the frame is brighter."""
    frame, render, residual = (image(document[name]) for name in ("frame", "render", "residual"))
    height, width = frame.shape
    wide = width > 1.8 * height
    size = (8, 0.7 + 3 * 8 * height / width) if wide else (0.9 + 3 * 5 * width / height, 5.6)
    drawn = figure(*size, document["title"])
    panels = drawn.subplots(3, 1) if wide else drawn.subplots(1, 3)
    show_image(panels[0], frame, "frame", cmap="gray", vmin=0, vmax=255)
    show_image(panels[1], render, "render, at the frame's brightness", cmap="gray", vmin=0, vmax=255)
    most = document["residual_range_dn"]
    left = (residual.astype(float) - 128) / 127 * most
    show_image(panels[2], left, "frame - render, DN", cmap="RdBu_r", vmin=-most, vmax=most)
    drawn.colorbar(panels[2].images[0], ax=panels[2], shrink=0.8).ax.grid(False)
    return drawn


def stereo(document):
    """Matches over the left frame, and errors of the points for whole-pixel and sub-pixel matching."""
    points = document["matches"]
    title = (f"{document['scene']}: {len(points)} points, depth {document['gain']:.1f} times better between pixels; "
             f"squared error over predicted variance {document['mean_normalised_squared']:.2f}")  # fmt: skip
    drawn = figure(14.5, 5.6, title)
    left, absolute, relative = drawn.subplots(1, 3, gridspec_kw={"width_ratios": [1.3, 1, 1]})
    show_image(left, image(document["left"]), "left frame; lines lead to the place in the right one", cmap="gray", vmin=0, vmax=255)
    for p in points:
        left.plot(*zip(p["left_px"], p["right_px"]), color=ORANGE, linewidth=0.8)
    left.plot(*np.transpose([p["left_px"] for p in points]), "o", color=VERMILION, markersize=3)
    left.set_xlim(-0.5, document["left"]["width"] - 0.5)
    left.set_ylim(document["left"]["height"] - 0.5, -0.5)
    boxes(absolute, points, "m")
    boxes(relative, points, "%")
    return drawn


def icp(document):
    """The share of starts from which the pose was found, over angle and distance of the start."""
    runs = document["runs"]
    angles, distances = (sorted({run[key] for run in runs}) for key in ("start_angle_deg", "start_distance_fraction"))
    drawn = figure(max(6, 1.6 * len(angles) + 1.5), 1.1 * len(distances) + 1.6, document["title"])
    axes = drawn.subplots()
    found = np.full((len(distances), len(angles)), np.nan)
    for run in runs:
        at = distances.index(run["start_distance_fraction"]), angles.index(run["start_angle_deg"])
        found[at] = run["found"] / run["starts"]
        silent = run["starts"] - run["found"] - run["told"]
        axes.text(at[1], at[0], f"{100 * found[at]:.1f} % of {run['starts']}\n{1e-3 * run['microseconds_p50']:.1f} ms\n"
                  f"{silent} wrong and credible", ha="center", va="center", fontsize=7.5, color=INK)  # fmt: skip
    axes.imshow(found, cmap="Greens", vmin=0, vmax=1.6, origin="lower", aspect="auto")
    axes.set_xticks(range(len(angles)), [f"{angle:g}" for angle in angles])
    axes.set_yticks(range(len(distances)), [f"{100 * part:g}" for part in distances])
    axes.set_xlabel("angle of the start, deg")
    axes.set_ylabel("shift of the start, % of the distance")
    axes.grid(False)
    return drawn


def filter_nees(document):
    """NEES (normalised estimation error squared) over time, with the 95 % band of a consistent filter."""
    runs = document["runs"]
    rows = math.ceil(len(runs) / 2)
    drawn = figure(11, 3.1 * rows + 0.4, document["title"])
    grid = list(drawn.subplots(max(1, rows), 2, squeeze=False).flat)
    for axes, run in zip(grid, runs):
        low, high = run["band"]
        axes.axhspan(low, high, color=GREEN, alpha=0.15)
        axes.axhline((low + high) / 2, color=GREY, linewidth=0.8)
        axes.plot(column(run["times"], "t_s"), column(run["times"], "nees"), color=BLUE)
        axes.set_title(f"{run['name']}: mean {run['nees']:.2f}, {100 * run['inside_band']:.0f} % of the times inside")
        axes.set_xlabel("time, s")
        axes.set_ylabel("NEES")
    for axes in grid[len(runs) :]:
        axes.set_axis_off()
    return drawn


def estimators(document):
    """Position error over the time of an estimate, for every estimator."""
    drawn = figure(9.5, 6.8, "Position error, RMS, against the time of an estimate")
    axes = drawn.subplots()
    families = list(dict.fromkeys(e["family"] for e in document["estimators"]))
    points = []
    for e in sorted(document["estimators"], key=lambda e: -e["position_error_of_range"]):
        x, y = e["ms"], 100 * e["position_error_of_range"]
        colour = CYCLE[families.index(e["family"]) % len(CYCLE)]
        axes.plot(x, y, "o", color=colour, markersize=5)
        points.append((x, y, e["estimator"], colour))
    logarithmic(axes)
    axes.margins(0.12)
    label_points(axes, points)
    axes.set_xlabel("time of an estimate, ms")
    axes.set_ylabel("position error, % of the range")
    return drawn


def label_points(axes, points):
    """Writes names beside their points, moved up or down to avoid other points and names."""
    axes.autoscale_view()
    axes.figure.canvas.draw()
    to_pixels = axes.transData.transform
    height = 11
    taken = [(px - 4, py - 4, px + 4, py + 4) for px, py in (to_pixels(p[:2]) for p in points)]
    right_edge = axes.get_window_extent().x1
    for x, y, name, colour in points:
        px, py = to_pixels((x, y))
        width = 5.2 * len(name)
        left = px + 8 if px + 8 + width < right_edge else px - 8 - width
        for step in range(40):
            shift = (step + 1) // 2 * height * (-1 if step % 2 else 1)
            box = (left, py + shift - height / 2, left + width, py + shift + height / 2)
            if not any(box[0] < t[2] and t[0] < box[2] and box[1] < t[3] and t[1] < box[3] for t in taken):
                break
        taken.append(box)
        scale = 72 / axes.figure.dpi
        arrow = {"arrowstyle": "-", "color": GREY, "linewidth": 0.6} if abs(shift) > height else None
        axes.annotate(name, (x, y), xytext=((left - px) * scale, shift * scale), textcoords="offset points", va="center",
                      color=colour, fontsize=7.5, arrowprops=arrow)  # fmt: skip


KINDS = {"estimates": estimates, "batch": batch, "calibration": calibration, "approach": approach, "approach_frames": approach_frames, "stereo": stereo, "icp": icp,
         "filter": filter_nees, "estimators": estimators, "comparison": comparison}  # fmt: skip
