"""Plots of `narpa dataset`: what a data set holds, and some of its images with their labels."""
import math

import numpy as np
from matplotlib.patches import Rectangle

from narpa.plots.style import BLUE, GREEN, SKY, VERMILION, figure, image, plain_ticks

COLUMNS = 6
STATES = {"visible": GREEN, "occluded": VERMILION}


def dataset(document):
    """A histogram of each quantity."""
    histograms = [h for h in document["histograms"].values() if h["counts"]]
    empty = f"{100 * document['empty_share']:.1f} % do not show the target"
    columns = min(3, max(1, len(histograms)))
    rows = max(1, math.ceil(len(histograms) / columns))
    drawn = figure(4 * columns, 2.6 * rows + 0.4, f"{document['title']}; {empty}")
    panels = drawn.subplots(rows, columns, squeeze=False).ravel()
    for axes, h in zip(panels, histograms):
        axes.stairs(h["counts"], h["edges"], fill=True, color=BLUE)
        if h["logarithmic"] and h["edges"][-1] > h["edges"][0]:
            axes.set_xscale("log")
            plain_ticks(axes.xaxis)
        axes.set_xlabel(h["label"])
        axes.set_ylabel("images")
    for axes in panels[len(histograms):]:
        axes.set_axis_off()
    return drawn


def contact_sheet(document):
    """Thumbnails with the target's box, its keypoints in green where they are visible, and range and phase angle."""
    tiles = document["tiles"]
    columns = min(COLUMNS, max(1, len(tiles)))
    rows = max(1, math.ceil(len(tiles) / columns))
    shape = image(tiles[0]["pixels"]).shape if tiles else (1, 1)
    drawn = figure(2.6 * columns, (2.6 * shape[0] / shape[1] + 0.25) * rows)
    for axes in drawn.subplots(rows, columns, squeeze=False).ravel():
        axes.set_axis_off()
    for axes, tile in zip(drawn.axes, tiles):
        pixels = image(tile["pixels"])
        axes.imshow(pixels, cmap="gray", vmin=0, vmax=255, interpolation="nearest")
        for x, y, width, height in np.array(tile["boxes"], float).reshape(-1, 4) / tile["step"]:
            axes.add_patch(Rectangle((x - 0.5, y - 0.5), width, height, fill=False, edgecolor=SKY, linewidth=0.8))
        for px, state in tile["keypoints"]:
            axes.plot(px[0] / tile["step"], px[1] / tile["step"], "o", color=STATES[state], markersize=2)
        phase = "" if tile["phase_deg"] is None else f", {tile['phase_deg']:.0f} deg"
        axes.set_title(f"{tile['image']}: {tile['range_m']:.4g} m{phase}", fontsize=7, fontweight="normal")
        axes.set_xlim(-0.5, pixels.shape[1] - 0.5)
        axes.set_ylim(pixels.shape[0] - 0.5, -0.5)
    return drawn


KINDS = {"dataset": dataset, "contact_sheet": contact_sheet}
