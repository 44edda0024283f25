"""Instructions per primary ray of the direct path, counted by callgrind and compared with direct_path.json.

    count.py check  --narpa BIN --scenes FOLDER ...   exit status 1 beyond the margins, 77 if it cannot be counted
    count.py renew  (the same)                        writes the counts to direct_path.json

The count covers narpa::CameraRenderer::render of one frame on one thread, without loading, detector and file output.
callgrind does not support AVX-512, so the AVX2 variants are counted. Counts depend on the compiler and on Embree:
they are compared only if both are the versions with which the stored counts were taken.

The counts of the craft are stored in the repository: models that its scene does not use must not add instructions. The
Cornell box under the Sun is counted twice in each run: as it is, and with further materials, sensors and other
elements that do not contribute to the image. They must not add instructions either.
"""

import argparse
import concurrent.futures
import json
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile

NUMBERS = pathlib.Path(__file__).with_name("direct_path.json")
SIZE = {"craft": 128, "box": 64}  # image width and height, px
MARGIN = 0.02  # relative margin of the stored counts
UNUSED_MARGIN = 0.001  # relative margin for elements that the image does not show
SKIPPED = 77

BOX = f"""
[sun]
direction = [0.3, 0.5, -0.8]

[[body]]
name = "box"
mesh = "box.obj"
scale = 0.001

[[camera]]
name = "front"
position_m = [0.278, 0.273, -0.8]
look_at = [0.278, 0.273, 0.0]
up = [0.0, 1.0, 0.0]
resolution = [{SIZE['box']}, {SIZE['box']}]
fov_horizontal_deg = 39.3
white_radiance = 500.0

[render]
method = "direct"
"""
UNUSED = """
[scene]
name = "a box with much beside it"
epoch = "2031-05-01T12:00:00Z"

[[camera]]
name = "other"
mount = "box"
position_m = [0.0, 0.0, -2.0]
resolution = [160, 120]
fov_horizontal_deg = 30.0
format = "YUYV"
embedded_line = true
lens = {focal_length_m = 0.05, f_number = 2.8, focus_distance_m = 2.0}
distortion = {model = "opencv", coefficients = [-0.2, 0.05, 0.001, 0.001]}
psf = {sigma_px = 1.0}
vignetting = {cos4 = true}
veiling_glare = 0.02
ghost = {strength = 1e-4, radius_px = 20, within_deg = 60}
shutter = {kind = "rolling", row_time_s = 1e-5}

[camera.detector]
read_noise_e = 5.0
shot_noise = true

[[lidar]]
name = "lidar"
model = "VLP-16"
mount = "box"
"""
UNUSED_MATERIALS = """
newmtl unused_glass
Kd 0.1 0.1 0.1
Ks 1.0 1.0 1.0
Ns 500
Ni 1.5
d 0.1
illum 7
newmtl unused_picture
Kd 1.0 1.0 1.0
map_Kd unused.ppm
bump -bm 0.01 unused.ppm
newmtl unused_lamp
Ke 50.0 50.0 50.0
map_Ke unused.ppm
"""


def skip(why):
    print("skipped: " + why)
    sys.exit(SKIPPED)


def small_craft(scenes, folder):
    """Writes the craft scene with fewer pixels."""
    source = scenes / "craft"
    resolution = f"resolution = [{SIZE['craft']}, {SIZE['craft']}]"
    text, sizes = re.subn(r"resolution = \[\d+, \d+\]", resolution, (source / "craft.toml").read_text())
    if sizes == 0:
        sys.exit(f"{source / 'craft.toml'}: expected cameras with a resolution")
    for name in ("craft.obj", "craft.mtl"):
        (folder / name).symlink_to((source / name).resolve())
    (folder / "craft.toml").write_text(text)
    return folder / "craft.toml"


def box(scenes, folder, unused):
    """Writes the Cornell box under the Sun, with or without elements that its image does not show."""
    folder.mkdir()
    (folder / "box.obj").symlink_to((scenes / "cornell" / "box.obj").resolve())
    materials = (scenes / "cornell" / "box.mtl").read_text()
    (folder / "box.mtl").write_text(materials + UNUSED_MATERIALS if unused else materials)
    (folder / "unused.ppm").write_text("P3 2 2 255\n" + "255 0 0  0 255 0  0 0 255  255 255 255\n")
    (folder / "box.toml").write_text(BOX + UNUSED if unused else BOX)
    return folder / "box.toml"


def instructions(narpa, scene, spp, name):
    """Instructions per primary ray of a frame of the scene's first camera."""
    out = scene.parent / name
    done = subprocess.run(
        ["valgrind", "--tool=callgrind", "--collect-atstart=no",
         "--toggle-collect=narpa::CameraRenderer::render(*)", f"--callgrind-out-file={out}.callgrind",
         narpa, "render", str(scene), "--spp", str(spp), "--threads", "1", "-o", f"{out}.png"],
        capture_output=True, text=True)
    if done.returncode != 0:
        sys.exit(f"narpa under valgrind ended with {done.returncode}:\n{done.stderr[-2000:]}")
    collected = re.search(r"Collected : (\d+)", done.stderr)
    if not collected or int(collected[1]) == 0:
        sys.exit("callgrind counted nothing: is narpa::CameraRenderer::render still the frame's function?")
    return round(int(collected[1]) / (SIZE[scene.stem] ** 2 * spp), 2)


def count(args):
    """Counts of the craft by samples per pixel, and of the box without and with the unused elements."""
    scenes = pathlib.Path(args.scenes)
    with tempfile.TemporaryDirectory() as name, concurrent.futures.ThreadPoolExecutor(os.cpu_count()) as pool:
        folder = pathlib.Path(name)
        craft = small_craft(scenes, folder)
        runs = {"1 spp": (craft, 1), "4 spp": (craft, 4),
                "box": (box(scenes, folder / "plain", False), 4),
                "box and more": (box(scenes, folder / "more", True), 4)}
        counts = {key: pool.submit(instructions, args.narpa, scene, spp, key) for key, (scene, spp) in runs.items()}
        return {key: running.result() for key, running in counts.items()}


def tools(args):
    valgrind = subprocess.run(["valgrind", "--version"], capture_output=True, text=True).stdout.strip()
    linked = subprocess.run(["ldd", args.narpa], capture_output=True, text=True).stdout
    library = re.search(r"libembree\S* => (\S+)", linked)
    version = pathlib.Path(library[1]).resolve().name if library else "linked statically"
    return {"valgrind": valgrind, "compiler": args.compiler, "build_type": args.build_type, "embree": version}


def held(what, counted, expected, margin):
    change = counted / expected - 1
    print(f"{what}: {counted} instructions per primary ray, {expected} expected, {100 * change:+.2f} %")
    return abs(change) <= margin


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=("check", "renew"))
    for key in ("narpa", "scenes", "build-type", "compiler"):
        parser.add_argument("--" + key, required=True)
    parser.add_argument("--sanitize", default="")
    args = parser.parse_args()

    if shutil.which("valgrind") is None:
        skip("there is no valgrind")
    if args.sanitize:
        skip("sanitizers change what is counted")
    cpu = pathlib.Path("/proc/cpuinfo")
    if not cpu.exists() or " avx2 " not in cpu.read_text() + " ":
        skip("the processor has no AVX2")
    if args.what == "check":
        if not NUMBERS.exists():
            sys.exit(f"{NUMBERS}: is not there, expected the numbers to hold; write it with: count.py renew")
        known = json.loads(NUMBERS.read_text())
        if known["tools"] != tools(args):
            skip(f"the numbers were taken with {known['tools']}, here is {tools(args)}")

    counted = count(args)
    free = held("box with what it does not show", counted["box and more"], counted["box"], UNUSED_MARGIN)
    crafts = {key: value for key, value in counted.items() if not key.startswith("box")}
    if args.what == "renew":
        NUMBERS.write_text(json.dumps({"tools": tools(args), "instructions_per_ray": crafts}, indent=2) + "\n")
        print(NUMBERS, crafts)
    else:
        good = [held(f"craft, {key}", crafts[key], expected, MARGIN)
                for key, expected in known["instructions_per_ray"].items()]
        if not all(good):
            command = " ".join(f'"{a}"' if " " in a or not a else a for a in sys.argv[2:])
            sys.exit(f"beyond {100 * MARGIN:g} %: where the change is meant, renew the numbers with\n"
                     f"  {sys.executable} {__file__} renew {command}")
    if not free:
        sys.exit(f"beyond {100 * UNUSED_MARGIN:g} %: what a scene names and does not show must cost nothing")


if __name__ == "__main__":
    main()
