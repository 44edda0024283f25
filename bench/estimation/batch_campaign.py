#!/usr/bin/python3
"""Gives `narpa estimate --batch` a wrong model of flown rehearsals, and counts what it finds.

Usage: batch_campaign.py FOLDER OUT.json [--every N] [--jobs N] [--runs N]
FOLDER: of `narpa rehearse SCENARIO --runs N`. For each run, three batches: with one error alone, a kind in turn; with all
errors; and with all errors over the known path. Errors are drawn from the priors, by the run's number.
"""
import argparse
import concurrent.futures
import json
import math
import pathlib
import random
import subprocess

# Standard deviations of the priors (docs/estimation.md, "All frames and sweeps at once").
KINDS = {
    "scale": {"scale": 0.02},
    "focal": {"focal": 0.02},
    "centre": {"centre_px.x": 5, "centre_px.y": 5},
    "k1": {"k1": 0.1},
    "camera mount": {f"camera_mount_deg.{axis}": 0.5 for axis in "xyz"},
    "LiDAR mount": {f"lidar_mount_deg.{axis}": 0.5 for axis in "xyz"},
    "clock": {"clock_s": 0.05},
    "range bias": {"range_bias_m": 0.05},
    "albedo": {"albedo": 0.1},
    "light": {"light_deg.x": 1, "light_deg.y": 1},
}
OF_LIDAR = ("scale", "LiDAR mount", "clock", "range bias")
PATH_SIGMA = "0.005,0.002"


def has_camera(run):
    return any(run.glob("emulator/*.ledger.csv"))


def draw(kinds, seed):
    """Errors of the model, within three standard deviations."""
    rng = random.Random(seed)
    errors = {}
    for kind in KINDS:
        for name, sigma in KINDS[kind].items():
            value = max(-3, min(3, rng.gauss(0, 1))) * sigma
            if kind in kinds:
                errors[name] = value
    return errors


def batch(run, errors, path, every):
    command = ["narpa", "estimate", str(run / "emulator"), "--batch", "--every", str(every), "--json", "--model-error",
               ",".join(f"{name}={value:.6g}" for name, value in errors.items())]
    if not has_camera(run):
        command += ["--lidar", next(run.glob("emulator/*.sweeps.csv")).name.removesuffix(".sweeps.csv")]
    if path:
        command += ["--path-sigma", PATH_SIGMA]
    done = subprocess.run(command, capture_output=True, text=True)
    if not done.stdout:
        return {"run": run.name, "errors": errors, "path": path, "failed": done.stderr.strip().splitlines()[-1:]}
    result = json.loads(done.stdout)["batch"]
    kept = ("unknowns", "unknowns_nees", "nees_mean", "settled", "linearisations")
    return {"run": run.name, "errors": errors, "path": path, **{key: result[key] for key in kept}}


def band(values, freedom):
    """95 % band of the mean of so many numbers with a chi-square distribution."""
    spread = 1.96 * math.sqrt(2 * freedom / max(1, len(values)))
    return f"{freedom - spread:.1f} to {freedom + spread:.1f}"


def table(name, rows):
    """Of each unknown: in how many batches it is determined, its largest error and median standard deviation."""
    print(f"\n{name}: {len(rows)} batches, {sum('failed' in r for r in rows)} without a solution")
    rows = [r for r in rows if "failed" not in r]
    if not rows:
        return
    print(f"    {'unknown':<20} {'determined':>10} {'median sigma':>13} {'RMS error/s.':>13} {'largest':>8}")
    for i, first in enumerate(rows[0]["unknowns"]):
        found = [r["unknowns"][i] for r in rows]
        determined = [u for u in found if u["determined"]]
        of_sigma = [u["error_of_sigma"] for u in determined] or [math.nan]
        sigma = sorted(u["sigma"] for u in found)[len(found) // 2]
        rms = math.sqrt(sum(e * e for e in of_sigma) / len(of_sigma))
        print(f"    {first['name']:<20} {len(determined):>4} of {len(found):<3} {sigma:>13.3g} {rms:>13.2f} {max(of_sigma):>8.2f}")
    nees = [r["unknowns_nees"] for r in rows]
    expected = len(rows[0]["unknowns"])
    print(f"    NEES of the unknowns {sum(nees) / len(nees):.1f}, {expected} expected (band {band(nees, expected)})")
    print(f"    NEES of the trajectory {sum(r['nees_mean'] for r in rows) / len(rows):.2f}, 6 expected")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("out", type=pathlib.Path)
    parser.add_argument("--every", type=int, default=10)
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--runs", type=int, help="of the folder (default: all)")
    o = parser.parse_args()
    runs = sorted(p for p in (o.folder / "runs").iterdir() if (p / "emulator" / "run.json").exists())
    runs = runs[: o.runs]
    if not runs:
        parser.error(f"{o.folder}: no runs, expected a folder of `narpa rehearse SCENARIO --runs N`")
    tasks = {"one error": [], "all errors": [], "all errors, path known": []}
    for number, run in enumerate(runs):
        kinds = [kind for kind in KINDS if has_camera(run) or kind in OF_LIDAR]
        tasks["one error"].append((run, draw([kinds[number % len(kinds)]], number), False))
        tasks["all errors"].append((run, draw(kinds, 1000 + number), False))
        tasks["all errors, path known"].append((run, draw(kinds, 1000 + number), True))
    results = {name: [] for name in tasks}
    with concurrent.futures.ThreadPoolExecutor(o.jobs) as pool:
        for name, group in tasks.items():
            for result in pool.map(lambda t: batch(*t, o.every), group):
                results[name].append(result)
                o.out.write_text(json.dumps(results, indent=1))
            table(name, results[name])


main()
