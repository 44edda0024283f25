"""The plot of `narpa replay --reference`."""
from matplotlib.colors import LinearSegmentedColormap

from narpa.plots.style import figure, image, show_image


def replay(document):
    """The worst frame, its reference, and their difference: red where the frame is too bright, blue where too dark."""
    panels = [image(document[key]) for key in ("frame", "reference", "difference")]
    height, width = panels[0].shape[:2]
    drawn = figure(15, 5 * height / width + 0.9, document["title"])
    signed = LinearSegmentedColormap.from_list("signed", ["#0000ff", "#ffffff", "#ff0000"])
    limit = document["difference_range_percent"]
    captions = (document["caption"], "reference", f"difference: white 0, red +{limit:.2g} %, blue -{limit:.2g} %")
    for axes, pixels, caption in zip(drawn.subplots(1, 3), panels, captions):
        how = {"cmap": signed, "vmin": 0, "vmax": 254} if pixels.ndim == 2 else {}
        show_image(axes, pixels, caption, **how)
    return drawn


KINDS = {"replay": replay}
