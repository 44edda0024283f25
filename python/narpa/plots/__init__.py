"""Plots of narpa's results, drawn with matplotlib from the JSON documents that its commands write.

Each document names its kind under the key "plot". For each kind there is a function that takes the document and returns
a matplotlib figure, or a dictionary of figures by name. The functions are in the modules of this package:

    bench        convergence, ladder, loop: `narpa bench render` and `narpa bench loop`
    estimation   estimates, batch, calibration, approach, approach_frames, stereo, icp, filter, estimators: `narpa estimate`, `bench estimate`;
                 comparison: `narpa compare`
    replay       replay: `narpa replay --reference`
    rehearsal    rehearsal, campaign: the charts of a rehearsal's page
    surface      map: `narpa map`
    dataset      dataset, contact_sheet: `narpa dataset`
"""
import argparse
import json
import logging
import sys
from pathlib import Path

PICTURES = (".png", ".svg", ".pdf")  # file extensions of pictures
MATPLOTLIB_MISSING = 3  # exit status, as narpa's: a dependency is missing


def drawers():
    from narpa.plots import bench, dataset, estimation, rehearsal, replay, surface

    return {name: function for module in (bench, estimation, replay, rehearsal, surface, dataset) for name, function in module.KINDS.items()}


def draw(document, output, picture_format=None):
    """Draws the document into a file, or into a folder if it has several charts. Returns the files written."""
    from narpa.plots import style

    kinds = drawers()
    kind = document.get("plot") if isinstance(document, dict) else None
    if kind not in kinds:
        raise ValueError(f'no plot document: "plot" is {kind!r}, expected one of {", ".join(sorted(kinds))}')
    with style.context():
        drawn = kinds[kind](document)
        if not isinstance(drawn, dict):
            drawn.savefig(output, format=picture_format)
            return [Path(output)]
        if Path(output).suffix in PICTURES:
            raise ValueError(f"has {len(drawn)} charts, expected a folder for them, not the file {output}")
        Path(output).mkdir(exist_ok=True)
        files = [Path(output) / f"{name}.{picture_format or 'svg'}" for name in drawn]
        for file, figure in zip(files, drawn.values()):
            figure.savefig(file)
        return files


def main(arguments=None):
    parser = argparse.ArgumentParser(prog="narpa-plot", description="Draws a plot document that a narpa command wrote.")
    parser.add_argument("document", metavar="FILE.json")
    parser.add_argument("-o", "--output", metavar="FILE.png", help="PNG, SVG or PDF file (default: FILE.png beside the "
                        "document); for the charts of a rehearsal a folder, which takes SVG files (default: FILE)")  # fmt: skip
    options = parser.parse_args(arguments)
    document = Path(options.document)
    try:
        import matplotlib
    except ImportError:
        print(f"{document}: not drawn, as matplotlib for Python is missing; the data are kept\n"
              f"  try: apt-get install python3-matplotlib && narpa-plot {document}", file=sys.stderr)  # fmt: skip
        return MATPLOTLIB_MISSING
    logging.getLogger("matplotlib").setLevel(logging.ERROR)
    try:
        content = json.loads(document.read_text())
        several = isinstance(content, dict) and content.get("plot") in ("rehearsal", "campaign")
        draw(content, options.output or document.with_suffix("" if several else ".png"))
    except (OSError, ValueError, KeyError, TypeError) as error:
        what = f"no {error}" if isinstance(error, KeyError) else error
        print(f"narpa-plot: {document}: {what}", file=sys.stderr)
        return 1
    return 0
