"""Cost of each optical stage of a camera in a frame of 1024 x 1024: instructions, counted by callgrind, and time.

    stages.py --narpa BIN --scenes FOLDER [--rounds N]

Prints the table of docs/performance.md, section "Optics". The count covers narpa::CameraRenderer::render on one thread, as
in count.py, in the AVX2 variants: callgrind does not support AVX-512. The time is the shortest frame of a run on one thread,
over N rounds of all stages; with N = 0, the default, times are not measured. Exit status 1 if a function of a stage
appears in the profile of the frame without stages.
"""

import argparse
import concurrent.futures
import csv
import math
import os
import pathlib
import re
import subprocess
import sys
import tempfile

SIDE = 1024
SCENE = """
[sun]
direction = {sun}

[[body]]
name = "craft"
mesh = "craft.obj"
{body}

[[camera]]
name = "near"
position_m = [11.0, -4.0, 15.0]
look_at = [0.0, 0.0, 0.6]
up = [0.0, 0.8, 0.7]
resolution = [{side}, {side}]
fov_horizontal_deg = 27.4
{camera}
[camera.detector]
{detector}

[render]
method = "direct"
spp = {spp}
"""
BEHIND = "[0.62, -0.48, 0.62]"  # the Sun is behind the camera, as in craft.toml
AHEAD = "[-0.72, 0.28, -0.70]"  # the Sun is behind the craft, 7 degrees from the camera's axis
TURNING = "rate_rad_s = [0.0, 0.0, 0.1]"

# Name, keys of the camera, samples per pixel, other parts of the scene. A row with name None is the baseline of the rows after it.
STAGES = [
    (None, "", 1, {}),
    ("psf, Gaussian of 1 px", "psf = {sigma_px = 1.0}", 1, {}),
    ("psf, Airy at f/8, 5 um, 550 nm", "psf = {wavelength_m = 5.5e-7}", 1, {"detector": "f_number = 8"}),
    ("psf, image of a coma, 15 px", 'psf = {image = "coma.pgm"}', 1, {}),
    ("vignetting", "vignetting = {cos4 = true}", 1, {}),
    ("veiling glare", "veiling_glare = 0.02", 1, {}),
    ("distortion, opencv, 5 coefficients",
     'distortion = {model = "opencv", coefficients = [-0.3, 0.1, 0.001, 0.001, 0.01]}', 1, {}),
    ("distortion, fisheye", 'distortion = {model = "fisheye", coefficients = [-0.02, 0.004, 0.0, 0.0]}', 1, {}),
    (None, "", 1, {"sun": AHEAD}),
    ("ghost of 100 px radius", "ghost = {strength = 1e-4, radius_px = 100, within_deg = 30}", 1, {"sun": AHEAD}),
    (None, "", 4, {}),
    ("thin lens, 4 spp", "lens = {aperture_diameter_m = 0.1, focus_distance_m = 18.0}", 4, {}),
    ("shutter, global, turning craft, 4 spp", 'shutter = {kind = "global"}', 4, {"body": TURNING}),
    ("shutter, rolling, turning craft, 4 spp", 'shutter = {kind = "rolling", row_time_s = 2e-5}', 4,
     {"body": TURNING}),
]  # fmt: skip
FUNCTIONS = ("ImageOptics::", "SunGhost::", "BrownConrady::", "KannalaBrandt::", "TabulatedModel::", "filter_of", "lens_direction", "StarLight::", "PointResponse::",
             "read_out", "CameraControl::", "mark_swept", "random_times", "move_camera")


def coma_image():
    """A PSF as 16-bit PGM: a Gaussian of 1 px and a fainter one beside it."""
    at = lambda x, y: math.exp(-0.5 * (x * x + y * y)) + 0.2 * math.exp(-((x - 2) ** 2 + y * y) / 8)
    samples = [round(60000 * at(x, y) / 1.1) for y in range(-7, 8) for x in range(-7, 8)]
    return b"P5 15 15 65535\n" + b"".join(s.to_bytes(2, "big") for s in samples)


def write_scenes(folder, scenes):
    for name in ("craft.obj", "craft.mtl"):
        (folder / name).symlink_to((pathlib.Path(scenes) / "craft" / name).resolve())
    (folder / "coma.pgm").write_bytes(coma_image())
    for number, (_, camera, spp, other) in enumerate(STAGES):
        parts = {"sun": BEHIND, "body": "", "detector": "f_number = 4", **other}
        (folder / f"{number}.toml").write_text(SCENE.format(camera=camera, spp=spp, side=SIDE, **parts))


def instructions(narpa, folder, number):
    """Instructions of one frame."""
    profile = folder / f"{number}.callgrind"
    done = subprocess.run(
        ["valgrind", "--tool=callgrind", "--collect-atstart=no",
         "--toggle-collect=narpa::CameraRenderer::render(*)", f"--callgrind-out-file={profile}",
         narpa, "render", str(folder / f"{number}.toml"), "--threads", "1", "-o", str(folder / f"{number}.png")],
        capture_output=True, text=True)  # fmt: skip
    collected = re.search(r"Collected : (\d+)", done.stderr)
    if done.returncode != 0 or not collected:
        sys.exit(f"narpa under valgrind ended with {done.returncode}:\n{done.stderr[-2000:]}")
    return int(collected[1])


def seconds(narpa, folder, number):
    """The shortest render time of a run's frames."""
    log = folder / f"log-{number}"
    done = subprocess.run(
        [narpa, "run", str(folder / f"{number}.toml"), "--video", "near=none", "--threads", "1", "--duration", "1.2",
         "--log", str(log)],
        capture_output=True, text=True)  # fmt: skip
    if done.returncode not in (0, 1):  # 1: frames were late
        sys.exit(f"narpa run ended with {done.returncode}:\n{done.stderr[-2000:]}")
    with open(log / "near.ledger.csv", newline="") as file:
        return min(int(row["t_render_end_ns"]) - int(row["t_render_start_ns"]) for row in csv.DictReader(file)) * 1e-9


def strange_functions(folder):
    """Functions of the stages that appear in the profile of the frame without stages."""
    text = (folder / "0.callgrind").read_text()
    return sorted({name for name in re.findall(r"(?m)^c?fn=\(\d+\) (.+)$", text) if any(f in name for f in FUNCTIONS)})


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--narpa", required=True)
    parser.add_argument("--scenes", required=True)
    parser.add_argument("--rounds", type=int, default=0)
    args = parser.parse_args()
    numbers = range(len(STAGES))
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        write_scenes(folder, args.scenes)
        with concurrent.futures.ThreadPoolExecutor(os.cpu_count()) as pool:
            counts = list(pool.map(lambda n: instructions(args.narpa, folder, n), numbers))
        rounds = [[seconds(args.narpa, folder, n) for n in numbers] for _ in range(args.rounds)]
        strange = strange_functions(folder)
    least = [min(of_stage) for of_stage in zip(*rounds)] or [math.nan] * len(STAGES)
    print("| stage | instructions a pixel | ratio, instructions | ratio, time | ms |\n|---|---|---|---|---|")
    base = 0
    for number, (stage, _, spp, _) in enumerate(STAGES):
        if stage is None:
            base = number
            print(f"| none, {spp} spp | {counts[number] / SIDE**2:.0f} | 1 | 1 | {1e3 * least[number]:.1f} |")
            continue
        more = (counts[number] - counts[base]) / SIDE**2
        ratio, time_ratio = counts[number] / counts[base], least[number] / least[base]
        print(f"| {stage} | {more:+.0f} | {ratio:.3f} | {time_ratio:.2f} | {1e3 * (least[number] - least[base]):+.1f} |")
    if strange:
        sys.exit("the frame without a stage ran: " + ", ".join(strange))


if __name__ == "__main__":
    main()
