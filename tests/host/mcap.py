#!/usr/bin/python3
"""The readers of MCAP and Protobuf that Foxglove uses open what `--mcap` writes: every message by the schema in the file, against
the run's own logs."""
import base64
import csv
import json
import shutil
import struct
import subprocess
import zlib
from pathlib import Path

import support
from support import expect, narpa

PACKAGES = ["@mcap/core@2", "@mcap/support@1", "protobufjs@7"]
STEPS = ["refined", "one_sample", "no_indirect", "coarse_2", "coarse_4", "nothing", "sparse"]  # kStepNames
POSES = support.flight(4)
FRAME_BYTES = support.WIDTH * support.HEIGHT
folder = support.work_folder()


def install_readers():
    if not shutil.which("npm") or not shutil.which("node"):
        support.skip("no npm; try: apt-get install npm")
    try:
        done = subprocess.run(["npm", "install", "--no-audit", "--no-fund", *PACKAGES], cwd=folder, capture_output=True, timeout=300)
    except subprocess.TimeoutExpired:
        support.skip("npm install took more than 300 s")
    if done.returncode != 0:
        support.skip(f"npm install {' '.join(PACKAGES)} fails: {done.stderr.decode(errors='replace').strip()[-200:]}")
    shutil.copy(Path(__file__).parent / "mcap_dump.mjs", folder)


def fly(name):
    """A flight in lockstep with an MCAP file; frame i shows POSES[i]. Returns the file's path and the run's summary."""
    port, path = support.free_port(), folder / f"{name}.mcap"
    with support.Run(support.SCENE, "--can", f"slcan:{port}", "--video", f"{support.CAMERA}={folder}/{name}.y4m", "--lidar",
                     f"{support.LIDAR}=none", "--lockstep", "--log", folder / name, "--mcap", path) as run:
        support.command_frames(run, port, POSES)
        return path, run.stop()


def read(path):
    """The messages by topic, and the summary."""
    done = subprocess.run(["node", folder / "mcap_dump.mjs", path], cwd=folder, capture_output=True, timeout=300)
    expect(done.returncode == 0, f"@mcap/core and protobufjs read {path.name}: {done.stderr.decode(errors='replace')[-500:]}")
    lines = [json.loads(line) for line in done.stdout.decode().splitlines()]
    topics = {}
    for line in lines[:-1]:
        topics.setdefault(line["topic"], []).append(line)
    return topics, lines[-1]


def rows(path):
    with open(path) as file:
        return list(csv.DictReader(file))


def nanoseconds(stamp):
    return int(stamp["seconds"]) * 1_000_000_000 + stamp["nanos"]


def check_frames(topics, ledger, frames):
    images = topics["/camera/nav/image"]
    expect(len(images) == len(ledger) == len(frames), f"{len(images)} images, as many as rows in the ledger and frames in the y4m")
    for image, row, frame in zip(images, ledger, frames):
        message = image["message"]
        data = base64.b64decode(message["data"])
        same = (data == frame and zlib.crc32(data) == int(row["image_crc32"], 16) and message["encoding"] == "mono8"
                and (message["width"], message["height"], message["step"]) == (support.WIDTH, support.HEIGHT, support.WIDTH)
                and message["frame_id"] == "camera/nav"
                and int(image["log_ns"]) == nanoseconds(message["timestamp"]) == int(row["t_exposure_mid_ns"])
                and int(image["publish_ns"]) == int(row["t_hand_over_ns"]))
        expect(same, f"image {row['frame']} has the bytes of the y4m, the checksum and the times of the ledger")


def check_ledger(topics, ledger):
    for entry, row in zip(topics["/camera/nav/ledger"], ledger, strict=True):
        for name, cell in row.items():
            value = entry["message"][name]
            if name == "image_crc32":
                same = value == int(cell, 16)
            elif name == "step":
                same = value == STEPS[int(cell)]
            elif name == "passes":
                same = value == [int(n) for n in cell.split(";") if n]
            elif isinstance(value, bool):
                same = value == (cell == "1")
            elif isinstance(value, float) or name in ("samples_per_pixel", "expected_error"):
                same = struct.pack("f", value) == struct.pack("f", float(cell))
            else:
                same = str(value) == cell
            if not same:
                expect(False, f"frame {row['frame']}: {name} is {value}, {cell} in the CSV")
    expect(True, "each column of the ledger's CSV has the same value in narpa.FrameLedger")


def check_calibration(topics):
    calibration = topics["/camera/nav/calibration"][0]["message"]
    expect(calibration["distortion_model"] == "plumb_bob" and calibration["D"] == [0] * 5, "the pinhole is a plumb_bob without distortion")
    expect(abs(calibration["K"][0] - 138.564) < 1e-3 and len(calibration["P"]) == 12, f"K has the focal length: {calibration['K']}")


def check_transforms(topics, truth):
    chaser = {round(float(row["t_s"]) * 1e9): row for row in truth if row["body"] == support.BODY}
    found = 0
    for entry in topics["/tf"]:
        transforms = {t["child_frame_id"]: t for t in entry["message"]["transforms"]}
        expect_set = {"body/bay", "body/ball", "body/buoy", "body/chaser", "camera/nav", "lidar/top"}
        if set(transforms) != expect_set:
            expect(False, f"transforms of {sorted(transforms)}")
        row = chaser.get(int(entry["log_ns"]))
        if row is None:
            continue
        found += 1
        t, q = transforms["body/chaser"]["translation"], transforms["body/chaser"]["rotation"]
        pose = [t["x"], t["y"], t["z"], q["w"], q["x"], q["y"], q["z"]]
        logged = [float(row[key]) for key in ("x_m", "y_m", "z_m", "qw", "qx", "qy", "qz")]
        if max(abs(a - b) for a, b in zip(pose, logged)) > 1e-9:
            expect(False, f"the chaser is at {pose}, {logged} in the truth")
    mount = transforms["camera/nav"]
    expect(found >= len(POSES) and mount["parent_frame_id"] == "body/chaser" and mount["translation"] == {"x": 0.03, "y": 0, "z": 0.05},
           f"{found} transforms are those of the log; the camera rides on the chaser")


def check_clouds(topics, sweeps):
    clouds = topics["/lidar/top/points"]
    expect(len(clouds) == len(sweeps) > 0, f"{len(clouds)} point clouds, as many as sweeps")
    for cloud, sweep in zip(clouds, sweeps):
        message = cloud["message"]
        data, stride = base64.b64decode(message["data"]), message["point_stride"]
        at = {f["name"]: f["offset"] for f in message["fields"]}
        types = [f["type"] for f in message["fields"]]
        points = len(data) // stride
        good = (len(data) % stride == 0 and points == int(sweep["returns"])
                and int(cloud["log_ns"]) == int(sweep["t_first_shot_ns"]) == nanoseconds(message["timestamp"])
                and int(cloud["publish_ns"]) == int(sweep["t_hand_over_ns"])
                and types == ["FLOAT32"] * 4 + ["UINT32", "UINT16", "UINT16", "UINT8"])
        last = int(sweep["t_last_shot_ns"]) - int(sweep["t_first_shot_ns"])
        for i in range(points):
            x, y, z, range_m = struct.unpack_from("<4f", data, i * stride)
            t, = struct.unpack_from("<I", data, i * stride + at["t"])
            beam, = struct.unpack_from("<H", data, i * stride + at["beam"])
            good &= abs((x * x + y * y + z * z) ** 0.5 - range_m) < 0.1 and t <= last + 2_000 and beam < 16
        expect(good, f"sweep {sweep['sweep']}: {points} points, its returns, at its times")


def y4m_frames(path):
    header, rest = path.read_bytes().split(b"\n", 1)
    expect(header.startswith(b"YUV4MPEG2"), "the y4m has a header")
    frames = []
    while rest:
        _, rest = rest.split(b"\n", 1)
        frames.append(rest[:FRAME_BYTES])
        rest = rest[FRAME_BYTES:]
    return frames


install_readers()
path, summary = fly("first")
topics, whole = read(path)
expect(whole["indexed"] == whole["streamed"] == whole["counted"] == summary["mcap"]["messages"] and whole["done"],
       f"{whole['indexed']} messages by index, as a stream with all checksums, in the statistics and in the run's report")
expect(whole["compression"] == "zstd" and whole["metadata"]["narpa"]["scene"] == "bench", f"zstd, and metadata {whole['metadata']}")
expect(summary["mcap"]["dropped"] == 0, "in lockstep nothing is dropped")
ledger = rows(folder / "first/nav.ledger.csv")
check_frames(topics, ledger, y4m_frames(folder / "first.y4m"))
check_ledger(topics, ledger)
check_calibration(topics)
check_transforms(topics, rows(folder / "first/nav.truth.csv"))
check_clouds(topics, rows(folder / "first/top.sweeps.csv"))

again, _ = fly("second")
expect(path.read_bytes() == again.read_bytes(), "the same flight gives the same bytes")

narpa("replay", folder / "first", "--mcap", folder / "replayed.mcap")
replayed, _ = read(folder / "replayed.mcap")
expect([m["message"] for m in replayed["/camera/nav/image"]] == [m["message"] for m in topics["/camera/nav/image"]],
       "replay --mcap writes the same images")
