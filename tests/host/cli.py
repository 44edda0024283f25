#!/usr/bin/python3
"""The command line for scripts: --help, one JSON document on standard output, exit codes, errors with file and line."""
import contextlib
import json
import math
import os
import re
import socketserver
import subprocess
import threading
import time
from pathlib import Path

import support
from support import expect, narpa

SUBCOMMANDS = {
    "check": ["SCENE", "--set", "--strict"],
    "run": ["--can", "--video", "--lidar", "--lockstep", "--duration", "--log", "--mcap", "--spp", "--budget-ms", "--budget-rays"],
    "fly": ["--can", "--lockstep"],
    "render": ["--camera", "--time", "--frame", "--trajectory", "--pose", "--format", "-o", "--set", "--strict", "--every"],
    "rehearse": ["SCENARIO", "--set", "--strict", "--mcap"],
    "map": ["--camera", "--of", "--body", "--interval", "--datum", "--up", "--time", "--pose", "-o"],
    "scan": ["--lidar", "--time", "--trajectory", "-o"],
    "estimate": ["--frame", "--sweep", "--no-truth", "--uncertainty", "--frame-noise", "--method", "--start"],
    "dataset": ["RECIPE", "-n, --images", "-o", "--shard", "--gather", "--verify", "--threads", "--set", "--strict"],
    "calibrate": ["IMAGE", "--trajectory", "--method", "--unknowns", "-o"],
    "compare": ["--frame", "--camera", "--target", "--pose", "-o"],
}
BUILD = Path(os.environ["NARPA_BUILD_DIR"])
folder = support.work_folder()


def check_help():
    general = narpa("--help").stdout.decode()
    expect("--json" in general, "--help lists --json")
    for name, options in SUBCOMMANDS.items():
        expect(name in general, f"--help names {name}")
        text = narpa(name, "--help").stdout.decode()
        missing = [option for option in options if option not in text]
        expect(not missing, f"{name} --help lists {' '.join(options)}" + (f", but not {missing}" if missing else ""))


def check_json():
    for arguments in (
        ["check", support.SCENE],
        ["render", support.SCENE, "--camera", support.CAMERA, "-o", folder / "a.png"],
        ["scan", support.SCENE, "--lidar", support.LIDAR, "-o", folder / "a.pcd"],
        ["run", support.SCENE, "--video", f"{support.CAMERA}={folder}/a.y4m", "--duration", "0.5", "--log", folder / "log"],
        ["run", support.SCENE, "--video", f"{support.CAMERA}=none", "--duration", "0.5", "--budget-ms", "20"],
    ):
        document = json.loads(narpa(*arguments, "--json").stdout)
        expect(isinstance(document, dict) and document, f"{arguments[0]} --json: one document, keys {sorted(document)}")


def expect_refusal(status, pattern, *arguments):
    """Expects this exit status, a message on standard error, and nothing on standard output."""
    done = narpa(*arguments, status=status)
    error = done.stderr.decode()
    expect(re.search(pattern, error), f"exit {status}, standard error has /{pattern}/: {error.strip()}")
    expect(not done.stdout, "and standard output has nothing")


def check_exit_codes():
    bad = support.scene_with(folder, "GREY")
    bad.write_text(bad.read_text().replace("albedo", "albdeo", 1))
    line = next(i for i, text in enumerate(bad.read_text().splitlines(), 1) if "albdeo" in text)
    expect_refusal(2, rf"bench_GREY\.toml:{line}:\d+: .*albdeo", "check", bad)
    expect_refusal(2, r"nowhere\.toml", "check", folder / "nowhere.toml")
    expect_refusal(2, r"cli\.py:\d+:\d+: .*expected a scene file \(TOML\)", "check", __file__)
    expect_refusal(2, "nadir.*nav", "render", support.SCENE, "--camera", "nadir", "-o", folder / "b.png")
    expect_refusal(2, "tiff", "render", support.SCENE, "-o", folder / "b.tiff")
    expect_refusal(2, "--lockstep", "run", support.SCENE, "--lockstep", "--video", f"{support.CAMERA}=none")
    expect_refusal(2, "--budget-rays", "run", support.SCENE, "--lockstep", "--can", "log:none", "--video",
                   f"{support.CAMERA}=none", "--budget-ms", "10")  # fmt: skip
    expect_refusal(2, "--spp", "run", support.SCENE, "--video", f"{support.CAMERA}=none", "--budget-ms", "10", "--spp", "2")
    expect_refusal(2, "--nonsense", "check", support.SCENE, "--nonsense")
    flight = folder / "flight.csv"
    flight.write_text("t_s,body,x_m,y_m,z_m,qw,qx,qy,qz,vx_m_s,vy_m_s,vz_m_s,wx_rad_s,wy_rad_s,wz_rad_s\n"
                      "0,chaser,0,0,zero,1,0,0,0,0,0,0,0,0,0\n")  # fmt: skip
    expect_refusal(2, r"flight\.csv:2:14: ", "fly", flight, "--can", "slcan:1")
    expect_refusal(3, "/dev/video99", "run", support.SCENE, "--video", f"{support.CAMERA}=/dev/video99", "--duration", "0.1")
    expect_refusal(3, "vcan99", "run", support.SCENE, "--can", "vcan99", "--video", f"{support.CAMERA}=none", "--duration", "0.1")


def check_names():
    """Scenes and scenarios are found by name; a file of the other kind is refused."""
    document = json.loads(narpa("list", "--json").stdout)
    names = {kind: {entry["name"] for entry in document[kind]} for kind in ("scenarios", "scenes", "datasets")}
    expect({"docking", "rbar", "dispersions"} <= names["scenarios"], f"list names scenarios: {sorted(names['scenarios'])}")
    expect({"docking", "cornell"} <= names["scenes"], f"list names scenes: {sorted(names['scenes'])}")
    expect(names["datasets"] == {"docking/docking-dataset"}, f"list names recipes of data sets: {names['datasets']}")
    expect_refusal(2, r"^narpa: docking/docking-dataset: is the recipe of a data set, expected a scene: `narpa dataset docking/docking-dataset` makes", "render", "docking/docking-dataset", "-o", folder / "a.png")
    by_name = json.loads(narpa("check", "docking", "--json").stdout)["scene"]
    by_file = json.loads(narpa("check", BUILD / "scenes/docking/docking.toml", "--json").stdout)["scene"]
    expect(by_name == by_file, "check docking is check of docking.toml")
    scenario = json.loads(narpa("check", "rbar", "--json").stdout)
    expect(scenario["scenario"]["name"] == "rbar" and scenario["scene"]["cameras"], "check takes a scenario, and its scene")
    legs_s = json.loads(narpa("check", "dispersions", "--json").stdout)["scenario"]["legs_s"]
    expect(90 < legs_s < 110, f"check states how long its legs take: {legs_s} s")
    short = folder / "short.toml"
    short.write_text(f'[scenario]\nbased_on = "{BUILD}/scenes/rehearsal/dispersions.toml"\nname = "short"\nscene = "{BUILD}/scenes/rehearsal/scene.toml"\nduration_s = 50.0\n')
    said = narpa("check", short).stderr.decode()
    expect(re.search(r"at most 50 s; its legs take about (\d+) s\nwarning: the run ends before its legs are flown: expected duration_s of \[scenario\] above \d+", said), f"check warns of legs that the duration cuts: {said[:300]}")
    expect_refusal(2, r"docking\.toml: is a scene, expected a scenario", "rehearse", BUILD / "scenes/docking/docking.toml")
    expect_refusal(2, r"rbar\.toml: is a scenario, expected a scene", "render", BUILD / "scenes/rehearsal/rbar.toml", "-o", folder / "a.png")
    expect_refusal(2, r"^narpa: rbar: is a scenario, expected a scene: `narpa rehearse rbar` flies it", "render", "rbar", "-o", folder / "a.png")
    expect_refusal(2, r"^narpa: cornell: is a scene, expected a scenario, .*`narpa render cornell`", "rehearse", "cornell")
    small = folder / "small.toml"
    small.write_text('sun.direction = [1.0, 0.0, 0.0]\n[[body]]\nname = "ball"\nsphere = {radius_m = 1.0}\n')
    expect_refusal(2, r"small\.toml: is a scene, expected a scenario", "rehearse", small)
    expect_refusal(2, r'dokcing: no such file, .*did you mean "docking"\?', "rehearse", "dokcing")
    expect_refusal(2, r"nowhere\.toml: no such file, expected a scene file", "run", folder / "nowhere.toml", "--video", "nav=none")


def check_words():
    """Help texts without the parser's notation, suggestions for misspelt words, version."""
    for name in ["", *SUBCOMMANDS, "rehearse", "estimate", "replay"]:
        text = narpa(*([name] if name else []), "--help").stdout.decode()
        for notation in ("TEXT:", "FLOAT:", "INT:", "UINT", "REQUIRED", "Excludes", "Positionals", "[OPTIONS]"):
            expect(notation not in text, f"narpa {name} --help has no {notation}")
        expect("Examples:\n" in text and f"Usage: narpa {name}".strip() in text, f"narpa {name} --help has usage and examples")
    for program, options in (("narpa-dynamics", ["--can BUS", "--patience SECONDS"]), ("narpa-navigation", ["--can BUS", "--video CAMERA=SOURCE"])):
        done = subprocess.run([BUILD / "bin" / program, "--help"], capture_output=True, text=True)
        expect(done.returncode == 0 and f"Usage: {program} SCENARIO" in done.stdout and "Examples:\n" in done.stdout, f"{program} --help has usage and examples")
        expect(all(option in done.stdout for option in options) and "REQUIRED" not in done.stdout, f"and {options}: {done.stdout}")
        done = subprocess.run([BUILD / "bin" / program, "x.toml", "--cna", "y"], capture_output=True, text=True)
        expect(done.returncode == 2 and 'no option "--cna"; did you mean "--can"' in done.stderr, f"{program} names the option meant: {done.stderr}")
    expect_refusal(2, 'no command "chek"; did you mean "check"', "chek", support.SCENE)
    expect_refusal(2, 'no command "rendr"; did you mean "render"', "bench", "rendr")
    expect_refusal(2, 'narpa render: there is no option "--sppp"; did you mean "--spp"', "render", support.SCENE, "--sppp", "3")
    expect_refusal(2, 'narpa render: there is no option "--samples"; did you mean "--spp"', "render", support.SCENE, "--samples", "3")
    expect_refusal(2, "--set changes the scene of the part approach, which --only leaves out", "bench", "estimate", "--only", "pnp", "--set", "render.seed=3")
    expect_refusal(2, 'unknown key "exposre_s" in', "bench", "loop", support.SCENE, "--set", f"camera.{support.CAMERA}.exposre_s=1")
    expect_refusal(2, "Usage: narpa COMMAND")
    version = narpa("--version").stdout.decode()
    expect(re.search(r"^narpa \d+\.\d+\.\d+(, commit [0-9a-f]{7,}.*)?\nvector instructions: .+\n", version), f"--version: {version!r}")


def check_errors():
    """Error messages name the wrong input, and partial results are kept."""
    expect_refusal(2, r'--pose "chaser=1,2", expected BODY=', "render", support.SCENE, "--pose", "chaser=1,2", "-o", folder / "a.png")
    expect_refusal(2, "nonsense: is neither a CAN bus nor a video device", "check", support.SCENE, "nonsense")
    done = narpa("check", support.SCENE, "/dev/video99", "--json", status=3)
    document = json.loads(done.stdout)
    expect(document["error"]["file"] == "/dev/video99" and document["scene"] and document["machine"], "check --json reports beside the error")
    done = narpa("check", support.SCENE, "can77", "/dev/video99", status=3)
    named = [line.split(":")[1].strip() for line in done.stderr.decode().splitlines() if line.startswith("narpa: ")]
    expect(named == ["can77", "/dev/video99"], f"check names every missing device: {named}")
    done = narpa("rehearse", "docking", "--can", "can77", "-o", folder / "can77", status=3)
    said = done.stderr.decode()
    expect(re.search(r"ended with status 3: can77: .+\n +try: ", said), f"rehearse names its child's reason: {said[-300:]}")
    command = [support.NARPA, "rehearse", "docking", "--navigation", "none", "-o", str(folder / "nobody")]
    done = subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=300)
    expect(done.returncode == 2 and "standard input has ended, expected Enter" in done.stderr, f"the end of standard input is no Enter: {done.stderr[-300:]}")
    done = narpa("rehearse", "docking", "--runs", "1", "--can", "can77", "-o", folder / "runs", status=1)
    said = done.stderr.decode()
    expect(re.search(r"run 1 failed: .*can77: ", said), f"a campaign names the reason of a run that left no result: {said[-300:]}")
    plural = folder / "plural.toml"
    plural.write_text('[scene]\nname = "x"\n[[bodies]]\nname = "a"\nsphere = {radius_m = 1.0}\n')
    expect_refusal(2, r'plural\.toml:3:\d+: unknown key "bodies".*did you mean "body"', "check", plural)


def check_numbers():
    """Invalid numbers, negative values and duplicate names are refused, not interpreted otherwise."""
    out = ["-o", folder / "no.png"]
    for arguments in (
        ["run", support.SCENE, "--video", f"{support.CAMERA}=none", "--duration", "nan"],
        ["render", support.SCENE, "--time", "nan", *out],
        ["render", support.SCENE, "--budget-ms", "nan", *out],
        ["scan", support.SCENE, "--lidar", support.LIDAR, "--duration", "inf", "-o", folder / "no.pcap"],
        ["render", support.SCENE, "--seed", "-1", *out],
    ):
        expect_refusal(2, re.escape(f"{arguments[-3] if arguments[-2] == '-o' else arguments[-1]}"), *arguments)
    expect_refusal(2, "--estimate-range-guess requires --estimate", "run", support.SCENE, "--estimate-range-guess", "5")
    two = folder / "two.csv"
    header = "t_s,body,x_m,y_m,z_m,qw,qx,qy,qz,vx_m_s,vy_m_s,vz_m_s,wx_rad_s,wy_rad_s,wz_rad_s\n"
    two.write_text(header + "".join(f"0,{name},0,0,0,1,0,0,0,0,0,0,0,0,0\n" for name in "ab"))
    fly = ["fly", two, "--can", f"log:{folder}/two.log", "--wait", "0"]
    expect_refusal(2, "nan", *fly, "--id", "a=0x100", "--id", "b=0x110", "--start", "nan")
    expect_refusal(2, "a=0x110: the body has an identifier already", *fly, "--id", "a=0x100", "--id", "a=0x110")
    expect_refusal(2, 'b=0x100: that is the identifier of body "a"', *fly, "--id", "a=0x100", "--id", "b=0x100")
    expect_refusal(2, 'body "b" has no identifier, expected --id b=ID', *fly, "--id", "a=0x100")


def check_output():
    """Messages about written files and rendered images."""
    aside = folder / "aside.toml"
    aside.write_text('[scene]\nname = "aside"\n[sun]\ndirection = [0.0, -1.0, 0.0]\n[[body]]\nname = "ball"\nsphere = {radius_m = 1.0}\n[[camera]]\nname = "eye"\n'
                     'position_m = [0.0, -9.0, 0.0]\nlook_at = [0.0, 0.0, 0.0]\nresolution = [64, 48]\nfov_horizontal_deg = 40.0\n')  # fmt: skip
    said = narpa("render", aside, "-o", folder / "new/a.png").stderr.decode()
    expect(f"wrote {folder}/new/a.png: 64 x 48, direct, " in said and "samples per pixel on average" in said, f"render: {said}")
    expect((folder / "new/a.png").exists() and "black" not in said, "it makes the folder; the ball is in view")
    said = narpa("render", aside, "--pose", "ball=0,-99,0,1,0,0,0", "-o", folder / "b.png").stderr.decode()
    expect("warning: every pixel is black: camera eye" in said, f"a camera that sees nothing is told: {said}")
    for arguments, file in ((["check", support.SCENE, "--dbc", folder / "new/a.dbc"], "new/a.dbc"),
                            (["scan", support.SCENE, "-o", folder / "new/a.ply"], "new/a.ply")):
        said = narpa(*arguments).stderr.decode()
        expect(f"wrote {folder}/{file}" in said and (folder / file).exists(), f"{arguments[0]}: wrote {file}")


def check_sensors():
    """Warnings about sensors inside their own body, and the calibration files of the sensors."""
    hull = folder / "hull.toml"
    text = ('[scene]\nname = "hull"\n[sun]\ndirection = [1.0, 0.0, 0.0]\n[[body]]\nname = "craft"\nsphere = {radius_m = 1.0}\n[[camera]]\nname = "eye"\nmount = "craft"\n'
            'position_m = [0.0, 0.0, %s]\nresolution = [64, 48]\nfov_horizontal_deg = 40.0\nrate_hz = 1.0\n'
            '[[lidar]]\nname = "top"\nmount = "craft"\nmodel = "VLP-16"\nposition_m = [0.0, 0.0, %s]\n')  # fmt: skip
    for z, inside in (("0.5", True), ("4.5", False)):
        hull.write_text(text % (z, z))
        said = narpa("check", hull).stderr.decode()
        for sensor, part in (("camera eye", "pixels show"), ("lidar top", "shots meet")):
            share = 100 if inside else 0
            expect(f"{sensor}: {share} % of its {part} body craft, which carries it" in said, f"{sensor} at {z} m on a ball of 1 m: {share} %")
            expect((f"warning: {sensor}" in said) == inside, "with a warning" if inside else "without a warning")
    narpa("check", "docking", "--calibration", folder / "calibration")
    camera = json.loads((folder / "calibration/calibration.json").read_text())["cameras"][0]
    expect(camera["mount"] == "chaser" and camera["camera_matrix"][0][0] > 100, "calibration.json has matrix and mount")
    info = (folder / "calibration/nav.yaml").read_text()
    expect("camera_matrix:" in info and f"image_width: {camera['width']}" in info, "and nav.yaml is a camera_info")


def check_exposure():
    """A saturated or black image is reported with a value for exposure_s; with this value the exposure is good."""
    scene = folder / "exposure.toml"
    text = ('[scene]\nname = "exposure"\n[sun]\ndirection = [-1.0, 0.0, 0.0]\n[[body]]\nname = "ball"\nsphere = {radius_m = 1.0}\n'
            '[[camera]]\nname = "eye"\nposition_m = [-5.0, 0.0, 0.0]\nlook_at = [0.0, 0.0, 0.0]\nresolution = [64, 48]\nfov_horizontal_deg = 40.0\n')  # fmt: skip
    scene.write_text(text + "[camera.detector]\nexposure_s = 0.002\n")
    for exposure_s, words in ((0.002, r"% of the pixels are saturated \(\d+ % have light\)"), (1e-9, "the image is black")):
        scene.write_text(text + f"[camera.detector]\nexposure_s = {exposure_s}\n")
        for arguments in (["render", scene, "-o", folder / "exposure.png"], ["check", scene]):
            said = narpa(*arguments).stderr.decode()
            advice = re.search(rf"warning: camera eye: .*{words}.*; expected exposure_s of about (\S+) ", said)
            expect(advice, f"{arguments[0]} with {exposure_s} s: {said.splitlines()[0] if advice is None else advice[0]}")
        scene.write_text(text + f"[camera.detector]\nexposure_s = {float(advice[1])}\n")
        done = narpa("render", scene, "-o", folder / "exposure.png", "--json")
        signal = json.loads(done.stdout)["signal"]
        expect(0.6 < signal["bright"] < 0.8 and "warning" not in done.stderr.decode(), f"with {advice[1]} s the exposure is good: {signal}")
    scene.write_text(text + "white_radiance = 10.0\n")
    said = narpa("render", scene, "-o", folder / "exposure.png").stderr.decode()
    expect(re.search(r"are saturated .*; expected white_radiance of about ", said), "without a detector it is white_radiance")


PLATE = """sun.direction = [-1.0, 0.3, 0.2]
[[body]]
name = "target"
mesh = "plate.obj"
scale = %s
[[camera]]
name = "eye"
position_m = [-4.0, 0.0, 0.0]
look_at = [0.0, 0.0, 0.0]
resolution = [64, 48]
fov_horizontal_deg = 20.0
[[camera]]
name = "side"
position_m = [-4.0, 0.5, 0.0]
look_at = [0.0, 0.0, 0.0]
resolution = [64, 48]
fov_horizontal_deg = 20.0
"""
# A closed box of 0.2 x 0.2 x 0.2 units.
BOX = "".join(f"v {x} {y} {z}\n" for x in (-0.1, 0.1) for y in (-0.1, 0.1) for z in (-0.1, 0.1)) + \
    "f 1 2 4 3\nf 5 7 8 6\nf 1 5 6 2\nf 3 4 8 7\nf 1 3 7 5\nf 2 6 8 4\n"


def check_sizes():
    """check states how large and how far bodies are for each camera, and doubts a mesh in millimetres or kilometres."""
    scene = folder / "size.toml"
    (folder / "plate.obj").write_text(BOX)
    focal = 32 / math.tan(math.radians(10))
    for scale, doubt in (("1.0", None), ("0.001", "is its mesh in another unit"), ("1000.0", "camera eye is inside body target, which is 200 m across")):
        scene.write_text(PLATE % scale)
        done = narpa("check", scene, "--json")
        said, body = done.stderr.decode(), json.loads(done.stdout)["scene"]["bodies"][0]
        size = 0.2 * float(scale)
        expect(all(abs(x - size) < 1e-6 * size for x in body["size_m"]), f"the size of {scale}: {body['size_m']}")
        view = body["views"][0]
        expect(view["camera"] == "eye" and abs(view["distance_m"] - 4) < 1e-6, f"4 m away: {view}")
        if scale != "1000.0":
            px = 2 * math.asin(size * math.sqrt(3) / 2 / 4) * focal
            expect(abs(view["size_px"] - px) < 1e-3 * px, f"and {px:.3g} px: {view}")
        expect(view["camera_inside"] == (scale == "1000.0"), f"inside: {view}")
        expect(f"body target: {size:.3g} m across; camera eye: 4 m away" in said, f"in words: {said}")
        expect(("another unit" in said or "inside body" in said) == (doubt is not None) and (doubt or "") in said, f"doubted: {doubt}")
        expect("expected white_radiance" not in said, f"no exposure is advised where the size is at fault: {said}")
    narpa("check", scene, "--strict", status=1)


def check_settings():
    """--set replaces keys, in `render` one after the other; a series of frames needs one process; --strict fails on warnings."""
    scene, flight = folder / "set.toml", folder / "set.csv"
    scene.write_text(PLATE % "1.0")
    narpa("render", scene, "-o", folder / "set.png")
    plain = (folder / "set.png").read_bytes()
    done = subprocess.run([support.NARPA, "render", str(scene), "-o", "-"], capture_output=True, timeout=600)
    expect(done.stdout == plain and done.returncode == 0, "-o - writes the same PNG to standard output")
    narpa("render", scene, "--set", "camera.eye.white_radiance=433", "-o", folder / "one.png")
    narpa("render", scene, "--set", "camera.eye.white_radiance=433,200", "--set", "camera.eye.fov_horizontal_deg=20,10", "-o", folder / "n_%02d.png")
    series = [(folder / f"n_0{k}.png").read_bytes() for k in range(4)]
    expect(series[0] == (folder / "one.png").read_bytes() and len(set(series)) == 4 and not (folder / "n_04.png").exists(), "a sweep has each pair of values")
    expect_refusal(2, r"n\.png: a series of images needs a number in the name", "render", scene, "--set", "camera.eye.white_radiance=4,5", "-o", folder / "n.png")
    expect_refusal(2, r'--set camera\.eye\.fov_horizontal=3: unknown key "fov_horizontal" in \[\[camera\]\]; did you mean "fov_horizontal_deg"', "check", scene, "--set", "camera.eye.fov_horizontal=3")
    expect_refusal(2, "2 values, expected one", "check", scene, "--set", "camera.eye.white_radiance=4,5")
    header = "t_s,body,x_m,y_m,z_m,qw,qx,qy,qz,vx_m_s,vy_m_s,vz_m_s,wx_rad_s,wy_rad_s,wz_rad_s\n"
    flight.write_text(header + "".join(f"{0.1 * k:.1f},target,0,{0.02 * k:.2f},0,1,0,0,0,0,0.2,0,0,0,0\n" for k in range(6)))
    done = narpa("render", scene, "--trajectory", flight, "--every", "0.2", "-o", folder / "fly/f_%05d.png", "--json")
    frames = json.loads(done.stdout)["frames"]
    expect([round(f["t_ns"] * 1e-9, 3) for f in frames] == [0, 0.2, 0.4] and [f["frame"] for f in frames] == [0, 2, 4], f"frames of a trajectory: {frames}")
    for k in range(3):
        narpa("render", scene, "--trajectory", flight, "--time", f"{0.2 * k}", "-o", folder / "alone.png")
        expect((folder / f"fly/f_0000{k}.png").read_bytes() == (folder / "alone.png").read_bytes(), f"frame {k} is that of a process of its own")
    expect_refusal(2, "--every steps through a trajectory", "render", scene, "--every", "1", "-o", folder / "f_%d.png")
    log = folder / "set-log"
    narpa("run", scene, "--set", "camera.eye.white_radiance=300", "--video", "eye=none", "--video", "side=none", "--duration", "0.3", "--log", log)
    expect(json.loads((log / "run.json").read_text())["set"] == ["camera.eye.white_radiance=300"], "a log keeps the options")
    narpa("replay", log)
    narpa("render", scene, "--strict", "-o", folder / "strict.png")
    scene.write_text((PLATE % "1.0") + "[camera.detector]\npixel_pitch_m = 5.5\n")
    (folder / "strict.png").unlink()
    said = narpa("check", scene).stderr.decode()
    expect("warning: camera side: pixel_pitch_m = 5.5 is unusual" in said and "micrometres, write 5.5e-06" in said, f"units are doubted: {said}")
    for command in (["check"], ["render", "-o", folder / "strict.png"], ["map", "-o", folder / "strict.pfm"]):
        error = narpa(command[0], scene, *command[1:], "--strict", status=1).stderr.decode()
        expect(re.search(r"warnings?, expected none with --strict", error), f"{command[0]} --strict: {error[-200:]}")
        document = json.loads(narpa(command[0], scene, *command[1:], "--strict", "--json", status=1).stdout)
        expect(any("5.5 is unusual" in text for text in document["warnings"]), f"{command[0]} --strict --json: {document}")
    expect(not (folder / "strict.png").exists(), "and nothing is rendered")


def check_silence():
    """Long commands report their progress and what they wait for."""
    flight = folder / "alone.csv"
    flight.write_text("t_s,body,x_m,y_m,z_m,qw,qx,qy,qz,vx_m_s,vy_m_s,vz_m_s,wx_rad_s,wy_rad_s,wz_rad_s\n0,chaser,0,0,0,1,0,0,0,0,0,0,0,0,0\n")
    said = narpa("fly", flight, "--can", f"slcan:{support.free_port()}", "--wait", "3", status=3).stderr.decode()
    expect("waiting at most 3 s for `narpa run`" in said, f"fly tells what it waits for: {said}")
    said = narpa("run", support.SCENE, "--video", f"{support.CAMERA}=none", "--duration", "4").stderr.decode()
    expect(re.search(r"running: t = .+ s of 4 s; .+: \d+ late, \d+ skipped, .+, \d+ %", said), f"run tells where it is: {said[:300]}")

    said = narpa("run", support.SCENE, "--video", f"{support.CAMERA}=none", "--duration", "1", "--threads", "1", "--spp", "500",
                 "--late-max", "10", status=1).stderr.decode()
    expect(re.search(r"failed: camera .+: \d+ of \d+ frames were late or skipped, expected at most 10 %", said),
           f"run tells that frames were late: {said[-300:]}")


def check_unix_times():
    """A trajectory that begins in days, such as one in Unix time, is refused at once, with the shift that mends it."""
    header = "t_s,body,x_m,y_m,z_m,qw,qx,qy,qz,vx_m_s,vy_m_s,vz_m_s,wx_rad_s,wy_rad_s,wz_rad_s\n"
    flight = folder / "unix.csv"
    flight.write_text(header + "".join(f"{1700000000 + 0.1 * k:.1f},chaser,0,0,0,1,0,0,0,0,0,0,0,0,0\n" for k in range(3)))
    expect_refusal(2, r"unix\.csv:2: the first row is at 1700000000 s, .*; --start=-1700000000 shifts",
                   "fly", flight, "--can", f"log:{folder}/unix.log", "--wait", "0")  # fmt: skip
    narpa("fly", flight, "--can", f"log:{folder}/unix.log", "--wait", "0", "--start=-1700000000")


def check_modes():
    """`fly` in another mode than the emulator fails at the first heartbeat and sends no command."""
    flight = folder / "modes.csv"
    flight.write_text("t_s,body,x_m,y_m,z_m,qw,qx,qy,qz,vx_m_s,vy_m_s,vz_m_s,wx_rad_s,wy_rad_s,wz_rad_s\n"
                      + "".join(f"{0.1 * k:.1f},chaser,-10,0,0,1,0,0,0,0,0,0,0,0,0\n" for k in range(5)))  # fmt: skip
    for mode, words in ((["--lockstep"], "the emulator runs in lockstep, expected --lockstep"),
                        ([], "the emulator runs in real time, expected no --lockstep")):  # fmt: skip
        bus = f"slcan:{support.free_port()}"
        with support.Run(support.SCENE, "--can", bus, "--video", f"{support.CAMERA}=none", *mode) as run:
            run.wait_for("commands: ")
            other = [] if mode else ["--lockstep"]
            expect_refusal(2, words, "fly", flight, "--can", bus, *other)
            if mode:
                narpa("fly", flight, "--can", bus, *mode)
                summary = json.loads(run.process.communicate(timeout=600)[0])
                taken, drops = summary["can"]["commands_taken"], summary["can"]["send_drops"]
                expect(taken == 5 and drops <= 2, f"fly --lockstep then commands it; at most the first and the last heartbeat had no client: {taken}, {drops}")
    with silent_hub() as bus:
        expect_refusal(1, r"no heartbeat in 1 s: .*--lockstep", "fly", flight, "--can", bus, "--wait", "1")
        narpa("fly", flight, "--can", bus, "--wait", "0")
        expect(True, "--wait 0 plays without heartbeats")


def check_gone():
    """`fly` fails if the emulator disappears before the end of the trajectory, but not if it was stopped; `run --duration` in lockstep
    fails if its clients leave before."""
    flight = folder / "gone.csv"
    flight.write_text("t_s,body,x_m,y_m,z_m,qw,qx,qy,qz,vx_m_s,vy_m_s,vz_m_s,wx_rad_s,wy_rad_s,wz_rad_s\n"
                      + "".join(f"{0.1 * k:.1f},chaser,-10,0,0,1,0,0,0,0,0,0,0,0,0\n" for k in range(40)))  # fmt: skip
    long = folder / "long.csv"
    long.write_text(flight.read_text() + "3600,chaser,-10,0,0,1,0,0,0,0,0,0,0,0,0\n")
    for mode, file, kill, status, words in (
        (["--lockstep"], long, True, 1, "the connection to the emulator was lost"),
        ([], flight, True, 1, "no heartbeat of the emulator for 10 s"),
        ([], flight, False, 0, r"the emulator stopped: \d+ of 40 rows were sent"),
    ):
        bus = f"slcan:{support.free_port()}"
        with support.Run(support.SCENE, "--can", bus, "--video", f"{support.CAMERA}=none", *mode) as run:
            run.wait_for("commands: ")
            fly = subprocess.Popen([support.NARPA, "fly", str(file), "--can", bus, *mode], stderr=subprocess.PIPE, text=True)
            time.sleep(1.5)
            run.process.kill() if kill else run.stop()
            said = fly.communicate(timeout=600)[1]
        expect(fly.returncode == status and re.search(words, said), f"fly {mode}, emulator {'killed' if kill else 'stopped'}: status {fly.returncode}, {said[-300:]}")
    for duration, status in (([], 0), (["--duration", "2"], 0), (["--duration", "30"], 1)):
        bus = f"slcan:{support.free_port()}"
        run = subprocess.Popen([support.NARPA, "run", str(support.SCENE), "--can", bus, "--video", f"{support.CAMERA}=none", "--lockstep", "--json", *duration],
                               stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)  # fmt: skip
        subprocess.run([support.NARPA, "fly", str(flight), "--can", bus, "--lockstep", "--wait", "30"], stderr=subprocess.DEVNULL, timeout=600)
        out, said = run.communicate(timeout=600)
        left = re.search(r"failed: the last client that sent commands left at [34]\.\d+ s, expected at 30 s, the end", said)
        expect(run.returncode == status and json.loads(out)["passed"] == (status == 0) and bool(left) == (status == 1),
               f"run {duration}, commanded for 4 s: status {run.returncode}, {said[-300:]}")


@contextlib.contextmanager
def silent_hub():
    """An slcan hub that answers requests and sends no frame."""

    class Client(socketserver.BaseRequestHandler):
        def handle(self):
            while data := self.request.recv(4096):
                self.request.sendall(b"".join({b"V": b"V1013\r", b"t": b"z\r", b"": b""}.get(line[:1], b"\r") for line in data.split(b"\r")))

    with socketserver.ThreadingTCPServer(("127.0.0.1", 0), Client) as server:
        server.daemon_threads = True
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield f"slcan:{server.server_address[1]}"
        server.shutdown()


def check_replay():
    """Every camera of the log is replayed, even if it lacks the scene's first camera; a log of LiDAR sweeps alone is refused."""
    scene = folder / "two.toml"
    scene.write_text('[scene]\nname = "two"\n[sun]\ndirection = [1.0, 0.0, 0.0]\n[[body]]\nname = "craft"\nsphere = {radius_m = 1.0}\n'
                     + "".join(f'[[camera]]\nname = "{name}"\nposition_m = [{x}, 0.0, 0.0]\nlook_at = [0.0, 0.0, 0.0]\nresolution = [64, 48]\nfov_horizontal_deg = 40.0\nrate_hz = 5.0\n'
                               for name, x in (("nav", 5.0), ("aft", 6.0)))
                     + '[[lidar]]\nname = "top"\nmodel = "VLP-16"\nposition_m = [5.0, 0.0, 0.0]\n')  # fmt: skip
    for cameras in (["nav", "aft"], ["aft"], []):
        log = folder / ("log-" + "-".join(cameras))
        video = [word for name in cameras for word in ("--video", f"{name}=none")]
        narpa("run", scene, *video, "--lidar", "top=none", "--duration", "1", "--log", log)
        if not cameras:
            expect_refusal(2, "has no log of a camera, .*sweeps of LiDARs are not replayed", "replay", log)
            continue
        done = narpa("replay", log, "--json")
        said, document = done.stderr.decode(), json.loads(done.stdout)
        expect(all(f"camera {name}: " in said for name in cameras) and "sweeps are not compared" in said, f"replay of {cameras}: {said}")
        replayed = [d["camera"] for d in document.get("cameras", [document])]
        expect(document["passed"] and sorted(replayed) == sorted(cameras), f"--json has {replayed}")


def check_devices():
    """check takes the devices of run by the same options, and others where they can be only one thing."""
    film = folder / "films/nav.y4m"
    done = narpa("check", support.SCENE, "--can", "slcan:0", "--video", f"{support.CAMERA}={film}", "--video", f"{support.CAMERA}=tcp:0",
                 "--lidar", f"{support.LIDAR}=udp:127.0.0.1:2368", "--lidar", f"{support.LIDAR}=none", "tcp:0", "--json")
    found = {f["name"]: f["there"] for f in json.loads(done.stdout)["machine"]}
    expect(all(found[name] for name in ("slcan:0", str(film), "tcp:0", "udp:127.0.0.1:2368", "none")), f"check finds {found}")
    expect(not film.parent.exists(), "check makes no file")
    expect_refusal(2, "udp:239.74.163.2: needs the option that says what it is, expected --can udp:239.74.163.2, --video CAMERA=udp:239.74.163.2, or --lidar LIDAR=udp:239.74.163.2", "check", support.SCENE, "udp:239.74.163.2")
    expect_refusal(2, 'no camera named "eye"', "check", support.SCENE, "--video", "eye=none")
    expect_refusal(2, f"--lidar {support.LIDAR}=can", "check", support.SCENE, "--lidar", f"{support.LIDAR}=can")
    expect_refusal(2, "expected /dev/videoN", "check", support.SCENE, "--video", f"{support.CAMERA}=film.mov")
    done = narpa("check", support.SCENE, "--video", f"{support.CAMERA}=/dev/video99", "--can", "can77", "--json", status=3)
    expect({"can77", "/dev/video99"} <= {f["name"] for f in json.loads(done.stdout)["machine"] if not f["there"]}, "check names missing ones")
    said = narpa("run", "--help").stdout.decode()
    expect(said.count("tcp:[ADDRESS:]PORT") == 1 and "ouster:[ADDRESS:]PORT" in said and "log:FILE" in said, "run --help lists the kinds")


def check_folders():
    """A log folder accepts one run at a time."""
    log = folder / "one-log"
    with support.Run(support.SCENE, "--video", f"{support.CAMERA}=none", "--log", log) as run:
        run.wait_for("camera ")
        expect_refusal(2, "one-log: is in use by another run", "run", support.SCENE, "--video", f"{support.CAMERA}=none", "--duration", "1", "--log", log)
        run.stop()


for check in (check_help, check_json, check_exit_codes, check_names, check_words, check_errors, check_numbers, check_output, check_sensors, check_exposure, check_sizes, check_settings, check_silence, check_unix_times, check_modes, check_gone, check_replay, check_devices, check_folders):
    check()
