#!/usr/bin/python3
"""`narpa map`: depth and contour lines of the shipped descent and terrain scenes, and of a ball with an analytic solution. OpenCV and an
XML parser read the files. Invalid input is refused."""
import base64
import importlib.util
import json
import math
import re
import resource
from pathlib import Path
from xml.etree import ElementTree

import support
from support import expect, narpa

try:
    import cv2, numpy as np  # noqa: E401
except ImportError as error:
    support.skip(f"{error} (python3-opencv)")

DRAWS = importlib.util.find_spec("matplotlib")
folder = support.work_folder()

BALL = """sun.direction = [0.0, -1.0, 0.0]
[[body]]
name = "ball"
sphere = {radius_m = 2.0}
position_m = [0.0, 0.0, 3.0]
[[camera]]
name = "eye"
position_m = [0.0, -10.0, 3.0]
look_at = [0.0, 0.0, 3.0]
resolution = [201, 151]
fov_horizontal_deg = 40.0
"""


def mapped(*arguments):
    return json.loads(narpa("map", *arguments, "--json").stdout)


def check_depth_of_the_descent():
    """A depth map as numbers, read by OpenCV."""
    summary = mapped("descent", "-o", folder / "depth.pfm")
    depth = cv2.imread(str(folder / "depth.pfm"), cv2.IMREAD_UNCHANGED)
    expect(depth.shape == (500, 500) and depth.dtype == np.float32, f"depth.pfm has a float for each pixel: {depth.shape}")
    limits = [float(depth.min()), float(depth.max())]
    expect(summary["pixels"] == 250_000 and np.allclose(limits, [summary["lowest_m"], summary["highest_m"]], 1e-6), f"from {limits} m")


def check_heights_of_the_descent():
    """Contour lines of the ground: their levels, closed rings, and positions on the level."""
    summary = mapped("descent", "--of", "height", "--body", "ground", "--interval", "5", "-o", folder / "height.json")
    document = json.loads((folder / "height.json").read_text())
    lines = document["lines"]
    levels = {line["level_m"] for line in lines}
    expect(levels == set(summary["levels_m"]) == {-15, -10, -5, 0, 5, 10, 15}, f"one level each 5 m: {sorted(levels)}")
    expect(len(lines) == summary["lines"] and any(line["closed"] for line in lines), f"{len(lines)} lines, some closed")
    for line in lines:
        px, heights = np.array(line["px"]), np.array(line["position_m"])[:, 2]
        if np.abs(heights - line["level_m"]).max() > 1e-4:
            expect(False, f"positions lie on level {line['level_m']}: {heights}")
        border = ((px[[0, -1]] == 0) | (px[[0, -1]] == 499)).any(axis=1).all()
        if not (line["closed"] and (px[0] == px[-1]).all() or border):
            expect(False, f"a line is closed or ends at the border: {px[[0, -1]]}")
    expect(True, "positions lie on their level, and lines are closed or end at the border")
    values = np.frombuffer(base64.b64decode(document["values_m"]), "<f4").reshape(500, 500)
    expect(abs(float(values.max()) - summary["highest_m"]) < 1e-4, "the document has the heights of all pixels")


def check_terrain_against_its_elevation_model():
    """Height maps from three altitudes of a descent agree with the PNG elevation model of the terrain, read by OpenCV. The
    tolerance covers craters of 2 to 8 m between the model's grid posts and an error of half a pixel."""
    scene = Path(next(s["file"] for s in json.loads(narpa("list", "--json").stdout)["scenes"] if s["name"] == "terrain"))
    posts = cv2.imread(str(scene.with_name("highland.png")), cv2.IMREAD_UNCHANGED)
    ground = 0.01 * posts.astype(np.float32) - 346
    row, column = np.indices((480, 640))
    for time_s in (0, 81, 97):
        at = ("terrain", "--time", str(time_s))
        mapped(*at, "-o", folder / "depth.pfm"), mapped(*at, "--of", "height", "-o", folder / "height.pfm")
        depth, height = (cv2.imread(str(folder / f"{name}.pfm"), cv2.IMREAD_UNCHANGED) for name in ("depth", "height"))
        metres = depth / (320 / math.tan(math.radians(30)))  # of a pixel on the ground
        x, y = (column - 319.5) * metres, (239.5 - row) * metres
        expected = cv2.remap(ground, np.float32(512 + x / 4), np.float32(512 - y / 4), cv2.INTER_CUBIC)
        off = np.abs(height - expected)
        expect(np.median(off) < 0.1 + 0.1 * metres.mean(), f"t = {time_s} s: half of the heights within {np.median(off):.3f} m of the PNG's")
        expect(np.quantile(off, 0.99) < 1.5 + 0.5 * metres.mean(), f"and 99 % within {np.quantile(off, 0.99):.2f} m")


def check_pictures():
    scene = folder / "ball.toml"
    scene.write_text(BALL)
    summary = mapped(scene, "--interval", "0.6", "-o", folder / "new/ball.svg")
    expect(np.allclose(summary["levels_m"], [8.4, 9.0]) and summary["lines"] == 2, f"a ball has a ring each level: {summary}")
    for line in json.loads((folder / "new/ball.json").read_text())["lines"]:
        z = line["level_m"]
        focal = 201 / 2 / math.tan(math.radians(20))
        radius = focal * math.sqrt(4 - (10 - z) ** 2) / z
        off = max(abs(math.hypot(x - 100, y - 75) - radius) for x, y in line["px"])
        expect(line["closed"] and off < 0.05, f"the ring at {z} m has a radius of {radius:.2f} px, {off:.2g} px off")
        height = max(abs(math.dist(p, (0, 0, 3)) - 2) for p in line["position_m"])
        expect(height < 1e-2, f"and lies on the ball: {height:.2g} m off")
    radius = mapped(scene, "--of", "radius", "--body", "ball", "--datum", "2", "-o", folder / "radius.pfm")
    expect(abs(radius["lowest_m"]) < 1e-6 and abs(radius["highest_m"]) < 1e-6, f"the ball's height above its radius is 0: {radius}")
    values = cv2.imread(str(folder / "radius.pfm"), cv2.IMREAD_UNCHANGED)
    expect(np.isnan(values[0, 0]) and np.isfinite(values).sum() == radius["pixels"], "NaN where there is no surface")
    if not DRAWS:
        return print("matplotlib is missing: pictures are not checked")
    texts = [text.text for text in ElementTree.parse(folder / "new/ball.svg").iter("{http://www.w3.org/2000/svg}text")]
    expect({"8.4", "9"} <= set(texts), f"the SVG is XML and labels its lines: {texts}")
    narpa("map", scene, "--interval", "0.5", "-o", folder / "ball.png")
    expect(cv2.imread(str(folder / "ball.png")).shape[0] > 400, "and the PNG is a picture")


def check_a_body_out_of_view():
    """A mask of a body that is not in the view is empty, which is no error."""
    scene, away = folder / "ball.toml", ("--body", "ball", "--pose", "ball=0,-99,0,1,0,0,0")
    for name in ("away.pfm", "away.json") + (("away.png",) if DRAWS else ()):
        done = narpa("map", scene, *away, "--interval", "1", "-o", folder / name, "--json") if name != "away.pfm" else \
            narpa("map", scene, *away, "-o", folder / name, "--json")
        expect("warning: the map is empty: camera eye sees no surface of body ball" in done.stderr.decode(), f"{name} has a warning")
        summary = json.loads(done.stdout)
        expect(summary["pixels"] == 0 and summary["lowest_m"] is None and summary["lines"] == 0, f"and no extremes: {summary}")
    values = cv2.imread(str(folder / "away.pfm"), cv2.IMREAD_UNCHANGED)
    expect(values.shape == (151, 201) and np.isnan(values).all(), "the file has NaN in each pixel")
    error = narpa("map", scene, *away, "--strict", "-o", folder / "away.pfm", status=1).stderr.decode()
    expect("1 warning, expected none with --strict" in error, f"--strict makes it an error: {error}")


def check_no_air_is_computed():
    """A map needs surfaces alone: an atmosphere costs no processor time. Its tables would take more than ten times as much."""
    def seconds(text):
        scene = folder / "earth.toml"
        scene.write_text(text)
        before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
        mapped(scene, "-o", folder / "earth.pfm")
        return resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before
    earth = BALL.replace("2.0", "6371000.0").replace("[0.0, 0.0, 3.0]\n[[camera]]", "[0.0, 6371090.0, 3.0]\n[[camera]]")
    without = seconds(earth)
    expect(seconds('atmosphere = {body = "ball", steps = 32, samples_per_band = 8}\n' + earth) < 1 + 3 * without, f"{without:.2f} s without")


def expect_refusal(pattern, *arguments):
    error = narpa("map", *arguments, status=2).stderr.decode()
    expect(re.search(pattern, error), f"refused with /{pattern}/: {error.strip()}")


def check_refusals():
    scene, out = folder / "ball.toml", ("-o", folder / "a.json")
    expect_refusal("interval of 0 m .*expected more than 0", scene, "--interval", "0", *out)
    expect_refusal("interval of -1 m .*expected more than 0", scene, "--interval", "-1", *out)
    expect_refusal(r"1569 levels between 8 and 9.5.* m, expected at most 1000: take 0.0016 m or more", scene, "--interval", "0.001", *out)
    expect_refusal("camera eye sees no surface from where it is", scene, "--pose", "ball=0,-99,0,1,0,0,0", *out)
    expect_refusal(r'a\.tif: unknown kind of file "\.tif", expected \.png', scene, "-o", folder / "a.tif")
    expect_refusal('--body bal: no such body.*did you mean "ball"', scene, "--body", "bal", *out)
    expect_refusal("--up 0,0,0, expected a direction", scene, "--of", "height", "--up", "0,0,0", *out)
    expect(not (folder / "a.json").exists(), "and nothing is written")
    said = narpa("map", scene, "--interval", "100", *out).stderr.decode()
    expect("warning: no contour line: depth reaches from 8" in said, f"an interval too wide is told: {said}")


for check in (check_depth_of_the_descent, check_heights_of_the_descent, check_terrain_against_its_elevation_model, check_pictures, check_a_body_out_of_view, check_no_air_is_computed, check_refusals):
    check()
