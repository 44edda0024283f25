#!/usr/bin/python3
"""An independent reader (python/narpa/ouster.py) decodes an OS1's packets from a capture with the metadata beside it. In each
profile every return of a turn is within half a range step of the ray-traced truth of its shot; no return is missing or extra.
Identifiers, column numbers and times agree with the metadata and the truth.
"""
import csv
import json

import support
from support import expect

try:
    import numpy as np

    from narpa import ouster
except ImportError as error:
    support.skip(f"{error} (python3-numpy)")

BEAMS, MODEL = 16, "os1-16"
START_NS = 1_795_262_400_000_000_000  # the scene's epoch, 2026-11-21T12:00:00Z
# Seen from the LiDAR: a ball that the Sun lights from the side, and a hill behind it (beams at the edge of the ball hit both);
# in the opposite direction a second hill. In other directions there is nothing.
SCENE = """
[scene]
name = "hills"
epoch = 2026-11-21T12:00:00Z
[sun]
direction = [1, 0.2, 0.3]
[[body]]
name = "far_hill"
sphere = {radius_m = 20}
position_m = [3, 32, 0]
material = {kind = "lambert", albedo = 0.6}
[[body]]
name = "ball"
sphere = {radius_m = 1.5}
position_m = [-24, 6, 0]  # beside the LiDAR after 2 s
velocity_m_s = [12, 0, 0]
rate_rad_s = [0, 0, 1]
material = {kind = "lambert", albedo = 0.3}
[[body]]
name = "near_hill"
sphere = {radius_m = 20}
position_m = [4, -35, 2]
material = {kind = "lambert", albedo = 0.6}
[[lidar]]
name = "os1"
model = "os1-16"
position_m = [0.5, 0, 0.4]
"""
STEP_M = {"RNG15_RFL8_NIR8": 0.008}


def write_scene(folder, name, keys):
    path = folder / f"{name}.toml"
    path.write_text(SCENE + keys)
    return path


def read_truth(scene, folder, *arguments):
    """Columns of the table of shots, each as an array of packets x columns x beams."""
    path = folder / "truth.csv"
    support.narpa("scan", scene, *arguments, "-o", path)
    with open(path, newline="") as file:
        rows = list(csv.DictReader(file))
    return {key: np.array([float(row[key]) for row in rows]).reshape(-1, ouster.COLUMNS, BEAMS) for key in rows[0]}


def check_numbers(packets, sensor, truth, what):
    turn = sensor.columns // ouster.COLUMNS
    for i, p in enumerate(packets):
        number = int(truth["packet"][i, 0, 0])
        first = number % turn * ouster.COLUMNS
        assert p.frame_id == number // turn and p.valid.all(), what
        assert (p.column == first + np.arange(ouster.COLUMNS)).all(), what
        assert (p.t_ns.astype(np.int64) - START_NS == truth["t_ns"][i, :, 0]).all(), what
        if sensor.profile == "LEGACY":
            assert (p.encoder == p.column.astype(int) * (90112 // sensor.columns)).all(), what
        else:
            assert (p.init_id, p.serial) == (sensor.init_id, sensor.serial) and sensor.serial > 0, what
            assert p.header[12:] == bytes(20) and p.footer == bytes(32), f"{what}: neither countdowns nor a CRC in firmware 2.4"
    expect(True, f"{what}: {len(packets)} packets have their frame, columns, times and identity")


def check_profile(folder, profile, columns, rate_hz, turns=1):
    keys = f'profile = "{profile}"\ncolumns = {columns}\nrate_hz = {rate_hz}\n'
    scene, what = write_scene(folder, f"{profile}_{columns}", keys), f"{profile}, {columns}x{rate_hz}"
    capture, time = folder / "os1.pcap", ("--time", 2, "--duration", turns / rate_hz)
    support.narpa("scan", scene, *time, "-o", capture)
    sensor, truth = ouster.Sensor(folder / "os1.json"), read_truth(scene, folder, *time)
    expect(sensor.profile == profile and (sensor.columns, sensor.rate_hz) == (columns, rate_hz), f"{what}: as the metadata state")
    data = list(sensor.read_pcap(capture))
    packets = [sensor.packet(p) for p in data]
    expect(len(packets) == turns * columns // 16 == len(truth["t_ns"]), f"{what}: {len(packets)} packets of {len(data[0])} bytes")
    check_numbers(packets, sensor, truth, what)

    range_mm = np.array([p.fields["range"] for p in packets])
    met = truth["range_m"] > 0
    expect((range_mm[met] > 0).all() and not range_mm[~met].any() and met.any() and not met.all(), f"{what}: {met.sum()} returns, none missing or extra")
    sensor_xyz = np.array([sensor.positions(p.column, p.fields["range"]) for p in packets])
    # narpa's LiDAR frame has the sensor's x forward as y, and its y left as -x.
    hit = np.stack([truth["y_m"], -truth["x_m"], truth["z_m"]], -1)
    worst = np.linalg.norm(sensor_xyz - hit, axis=-1)[met].max()
    expect(worst <= 0.5001 * STEP_M.get(profile, 0.001), f"{what}: the worst point is {worst * 1000:.3f} mm from its ray-traced hit")

    reflectivity = np.array([p.fields["reflectivity"] for p in packets])
    expect((np.abs(reflectivity - 100 * truth["reflectivity"]) <= 0.5001).all(), f"{what}: reflectivity in percent")
    near_ir = np.array([p.fields["near_ir"] for p in packets])
    lit = near_ir[met & (truth["body"] == 1)]
    expect(lit.max() > 100 and lit.min() == 0, f"{what}: near-infrared light of the ball's sunlit side, none of the other one ({lit.max()} photons at most)")
    if "signal" in packets[0].fields:
        signal = np.array([p.fields["signal"] for p in packets])[met]
        photons = 25000 * truth["reflectivity"][met] / truth["range_m"][met] ** 2
        expect((np.abs(signal - np.minimum(photons, 65535)) <= 0.51).all(), f"{what}: signal falls with the square of the range")
    return sensor, packets, truth


def check_dual(folder):
    profile = "RNG19_RFL8_SIG16_NIR16_DUAL"
    scene = write_scene(folder, "edges", f'profile = "{profile}"\ncolumns = 1024\nbeam_divergence_rad = 0.02\nsub_rays = 32\n')
    support.narpa("scan", scene, "--time", 2, "-o", folder / "edges.pcap")
    sensor, truth = ouster.Sensor(folder / "edges.json"), read_truth(scene, folder, "--time", 2)
    packets = [sensor.packet(p) for p in sensor.read_pcap(folder / "edges.pcap")]
    for field, key in (("range", "reported_range_m"), ("range2", "second_range_m")):
        got, wanted = np.array([p.fields[field] for p in packets]), truth[key]
        there = wanted > 0
        off_mm = np.abs(got[there] - 1000 * (wanted[there] + sensor.n_m)).max()
        expect(off_mm <= 0.5001 and not got[~there].any(), f"dual, {field}: {there.sum()} returns, within {off_mm:.3f} mm")
        expect(there.sum() > 20, f"dual, {field}: there are some")
    first, second = (np.array([p.fields[f] for p in packets]) for f in ("signal", "signal2"))
    both = truth["second_range_m"] > 0
    expect((first[both] >= second[both]).all(), f"dual: the stronger of {both.sum()} pairs comes first")
    farther = (truth["reported_range_m"] > truth["second_range_m"])[both]
    expect(farther.any() and not farther.all(), f"dual: the stronger one is the farther one in {farther.sum()} of them")
    points = np.concatenate([sensor.decode(p) for p in sensor.read_pcap(folder / "edges.pcap")])
    expect(len(points) == (truth["reported_range_m"] > 0).sum() + both.sum(), f"dual: {len(points)} points")


def check_run(folder):
    """A run in lockstep records the same packets as a scan, and the metadata beside them."""
    scene = write_scene(folder, "run", 'columns = 512\nrate_hz = 20\n[[body]]\nname = "commanded"\nsphere = {radius_m = 1e-6}\ncan_id = 0x100\n')
    log, capture = folder / "commands.log", folder / "run.pcap"
    support.narpa("fly", write_flight(folder), "--id", "commanded=0x100", "--start", 0, "--lead", 0, "--wait", 0, "--can", f"log:{log}")
    support.narpa("run", scene, "--can", f"log:{log}", "--lockstep", "--lidar", f"os1={capture}")
    support.narpa("scan", scene, "--duration", 0.1, "-o", folder / "scan.pcap")
    sensor = ouster.Sensor(folder / "run.json")
    run, scan = list(sensor.read_pcap(capture)), list(sensor.read_pcap(folder / "scan.pcap"))
    expect(len(scan) == 64 and run[: len(scan)] == scan, f"run: {len(run)} packets, the first {len(scan)} byte for byte those of a scan")
    expect(json.loads((folder / "run.json").read_text()) == json.loads((folder / "scan.json").read_text()), "run: the same metadata")


def write_flight(folder):
    path = folder / "flight.csv"
    rows = ["t_s,body,x_m,y_m,z_m,qw,qx,qy,qz,vx_m_s,vy_m_s,vz_m_s,wx_rad_s,wy_rad_s,wz_rad_s"]
    rows += [f"{0.01 * i},commanded,100,100,100,1,0,0,0,0,0,0,0,0,0" for i in range(21)]
    path.write_text("\n".join(rows) + "\n")
    return path


def check_errors(folder):
    text = SCENE.rstrip("\n").count("\n") + 2
    for keys, line, expected in (
        ('profile = "RNG19"\n', text, 'profile: "RNG19" is not known here, expected one of "LEGACY"'),
        ("columns = 100\n", text, "columns: got 100, expected an integer in [512, 2048]"),
        ("columns = 600\n", text, "columns: expected columns and rate_hz of one of 512x10"),
        ("rate_hz = 20\ncolumns = 2048\n", text + 1, "columns: expected columns and rate_hz of one of 512x10"),
        ("rate_hz = 15\n", text, "rate_hz: expected columns and rate_hz of one of 512x10"),
        ('returns = "last"\n', text, "returns: the profile decides on them"),
        ('calibration = "no.json"\n', text, "no.json: no such file"),
        ('calibration = "bad.json"\n', text, "bad.json:3: beam_altitude_angles: expected numbers"),
    ):
        (folder / "bad.json").write_text('{\n\n"beam_altitude_angles": ["up"]}')
        scene = write_scene(folder, "bad", keys)
        words = support.narpa("check", scene, status=2).stderr.decode()
        expect(f"bad.toml:{line}:" in words and expected in words, f"an error names line {line} and says {expected}")


def main():
    folder = support.work_folder()
    for profile, columns, rate_hz in (("LEGACY", 512, 10), ("RNG19_RFL8_SIG16_NIR16", 1024, 20),
                                      ("RNG19_RFL8_SIG16_NIR16_DUAL", 512, 20), ("RNG15_RFL8_NIR8", 2048, 10)):  # fmt: skip
        check_profile(folder, profile, columns, rate_hz)
    check_dual(folder)
    check_run(folder)
    check_errors(folder)


main()
