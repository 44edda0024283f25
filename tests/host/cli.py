#!/usr/bin/python3
"""The command line for scripts: --help, one JSON document on standard output, exit codes, errors with file and line."""
import json
import re

import support
from support import expect, narpa

SUBCOMMANDS = {
    "check": ["SCENE"],
    "run": ["--can", "--video", "--lidar", "--lockstep", "--duration", "--log", "--spp", "--budget-ms", "--budget-rays"],
    "fly": ["--can", "--lockstep"],
    "render": ["--camera", "--time", "--frame", "--trajectory", "--pose", "--format", "-o"],
    "scan": ["--lidar", "--time", "--trajectory", "-o"],
}
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
    """The exit status, a message on standard error, and nothing on standard output."""
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


check_help()
check_json()
check_exit_codes()
