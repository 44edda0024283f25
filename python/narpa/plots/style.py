"""Helpers of all plots: colours, figures, images in documents, robust logarithmic axes."""
import base64
import math

import matplotlib
import numpy as np
from matplotlib.figure import Figure

# Colours that remain distinct in all kinds of colour blindness (M. Okabe, K. Ito, 2008).
BLUE, VERMILION, GREEN, ORANGE = "#0072B2", "#D55E00", "#009E73", "#E69F00"
SKY, PURPLE, GREY, INK = "#56B4E9", "#CC79A7", "#8a8f98", "#1d232b"
CYCLE = (BLUE, VERMILION, GREEN, PURPLE, ORANGE, GREY)


def context():
    return matplotlib.rc_context({
        "font.size": 9, "axes.titlesize": 9.5, "axes.titleweight": "bold", "figure.titlesize": 11, "legend.fontsize": 8.5,
        "axes.grid": True, "grid.color": "#e1e4e8", "grid.linewidth": 0.7, "axes.axisbelow": True, "axes.edgecolor": "#5b6470",
        "axes.spines.top": False, "axes.spines.right": False, "legend.frameon": False,
        "savefig.dpi": 110, "svg.fonttype": "none", "svg.hashsalt": "narpa",
    })  # fmt: skip


def figure(width, height, title=""):
    """A figure with automatic layout; width and height in inches."""
    made = Figure(figsize=(width, height), constrained_layout=True)
    if title:
        made.suptitle(title)
    return made


def number(value):
    """NaN for null: numbers that are not finite are null in JSON."""
    return math.nan if value is None else value


def column(rows, key):
    return np.array([number(row[key]) for row in rows], float)


def positive(values):
    """The values with NaN in place of those that a logarithmic axis cannot show."""
    values = np.asarray(values, float)
    return np.where(values > 0, values, np.nan)


def image(document):
    """Decodes an image of a document to an array: height x width x 3, or height x width for grey."""
    pixels = np.frombuffer(base64.b64decode(document["base64"]), np.uint8)
    shape = (document["height"], document["width"], document["channels"])
    return pixels.reshape(shape if document["channels"] > 1 else shape[:2])


def show_image(axes, pixels, title="", **how):
    axes.imshow(pixels, interpolation="nearest" if min(pixels.shape[:2]) < 120 else "antialiased", **how)
    axes.set_title(title)
    axes.set_xticks([])
    axes.set_yticks([])
    axes.grid(False)


def plain_ticks(axis):
    """Labels a logarithmic axis with plain numbers (0.5, 20) instead of powers of ten."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    decades = abs(math.log10(axis.get_view_interval()[1] / axis.get_view_interval()[0]))
    axis.set_major_locator(LogLocator(subs=(1, 2, 5) if decades < 3 else (1,)))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_formatter(NullFormatter())


def logarithmic(axes, which="xy"):
    for name in which:
        getattr(axes, f"set_{name}scale")("log")
        plain_ticks(getattr(axes, f"{name}axis"))
