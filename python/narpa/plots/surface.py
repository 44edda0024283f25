"""The picture of `narpa map`: depth or height in false colour with hill shading and contour lines."""
import base64

import numpy as np
from matplotlib import colormaps
from matplotlib.cm import ScalarMappable
from matplotlib.colors import ListedColormap, Normalize
from matplotlib.contour import ContourSet

from narpa.plots.style import figure, image

INDEX_EVERY = 5  # every fifth contour line is thicker and labelled
FEW_LEVELS = 12  # with at most so many levels all are labelled


def surface_map(document):
    size = document["height"], document["width"]
    values = np.frombuffer(base64.b64decode(document["values_m"]), "<f4").reshape(size)
    drawn = figure(1.6 + 6 * min(1, size[1] / size[0]), 0.9 + 6 * min(1, size[0] / size[1]), document["title"])
    axes = drawn.subplots()
    near_is_bright = document["of"] in ("depth", "range")
    hues = ListedColormap(colormaps["viridis"](np.linspace(0.25, 1, 256)))  # without the dark end, where black lines would not be visible
    is_empty = document["lowest_m"] is None
    limits = (0, 1) if is_empty else (document["lowest_m"], document["highest_m"])
    colours = ScalarMappable(Normalize(*limits), hues.reversed() if near_is_bright else hues)
    light = 0.5 + 0.5 * image(document["shade"])[..., None] / 255
    rgb = np.where(np.isfinite(values)[..., None], colours.to_rgba(values)[..., :3] * light, 0.1)
    axes.imshow(rgb, interpolation="nearest")
    axes.grid(False)
    axes.set(xlabel="x, px", ylabel="y, px")
    unit = f"{document['of']}, m" + (f" above {document['datum_m']:.10g}" if document["datum_m"] else "")
    legend = drawn.colorbar(colours, ax=axes, label=unit).ax
    legend.grid(False)
    if near_is_bright:
        legend.invert_yaxis()
    if document["lines"]:
        draw_lines(axes, document)
    return drawn


def draw_lines(axes, document):
    by_level = {level: [] for level in document["levels_m"]}
    for line in document["lines"]:
        by_level[line["level_m"]].append(np.array(line["px"]))
    levels = [level for level in by_level if by_level[level]]
    index = [round(level / document["interval_m"]) % INDEX_EVERY == 0 for level in levels]
    widths = [1.2 if i else 0.5 for i in index]
    contours = ContourSet(axes, levels, [by_level[level] for level in levels], colors="black", linewidths=widths, linestyles="solid")
    labelled = [level for level, i in zip(levels, index) if i or len(levels) <= FEW_LEVELS]
    axes.clabel(contours, labelled, fmt="%.10g", fontsize=7)


KINDS = {"map": surface_map}
