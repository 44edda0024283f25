#!/usr/bin/python3
"""Data sets and campaigns on a Slurm of two nodes, one of which is lost: the same bytes as on this machine, and nothing made twice.

Usage: slurm.py dataset | rehearse
With NARPA_CAMPAIGN in the environment: 10,000 images of 256 x 256, 200 runs."""
import filecmp
import json
import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

import slurm_nodes
import support
from support import NARPA, expect, narpa

IS_CAMPAIGN = "NARPA_CAMPAIGN" in os.environ
IMAGES, SHARDS, RUNS = (10000, 8, 200) if IS_CAMPAIGN else (24, 4, 3)
IMAGE = ["render.spp=1", "camera.nav.resolution=[256, 256]"] if IS_CAMPAIGN else ["render.spp=400"]
WAIT_S = 7200 if IS_CAMPAIGN else 600
SCENARIO = Path(os.environ["NARPA_BUILD_DIR"]) / "scenes/rehearsal/dispersions.toml"


def printed(*arguments, status=0):
    return json.loads(narpa(*arguments, "--json", status=status).stdout)


def files(of):
    """Those of the results: not the pictures, which matplotlib draws, nor the job scripts and logs."""
    return sorted(p.relative_to(of) for p in of.rglob("*") if p.is_file() and p.suffix != ".png" or p.parent.name in ("images", "masks"))


def expect_same(one, other, what, names):
    different = [str(f) for f in names if not (other / f).is_file() or not filecmp.cmp(one / f, other / f, shallow=False)]
    expect(not different, f"{what}: {len(names)} files have the same bytes {different}")


def check_no_sbatch(*command):
    done = subprocess.run([NARPA, *map(str, command), "--on", "slurm"], capture_output=True, text=True, env=os.environ | {"PATH": "/nowhere"})
    expect(done.returncode == 3 and "no sbatch on PATH" in done.stderr and "apt-get install slurm-client" in done.stderr,
           f"without sbatch: status 3 and what provides it: {done.stderr.strip()}")


def release(cluster):
    """Starts a task that was queued again: Slurm would hold it for two minutes."""
    cluster.wait_for(lambda: "BeginTime" in cluster.output("squeue", "-h", "-o", "%r"), "the task of the lost node is in the queue again", 120)
    for job in cluster.output("squeue", "-h", "-t", "PENDING", "-o", "%i %r").splitlines():
        if job.endswith("BeginTime"):
            subprocess.run(["scontrol", "update", f"jobid={job.split()[0]}", "starttime=now"], check=True)


def task_on(cluster, node):
    """The number, from 1, of the task that the node works on; 0: none."""
    return max((int(v.get("SLURM_ARRAY_TASK_ID", 0)) for v in cluster.jobs_programs(node).values()), default=0)


def lose_node_in_the_middle(cluster, shared):
    """Kills node n2 when it has made some of the images of a shard. Returns the shard's number and its images."""

    def partly():
        task = task_on(cluster, "n2")
        labels = [p for p in shared.glob("labels/0*.json") if int(p.stem) % SHARDS == task - 1]
        return (task, labels) if task and 1 <= len(labels) < IMAGES // SHARDS - 1 else None

    cluster.wait_for(partly, "a node has made a part of its shard")
    task, _ = partly() or (0, [])
    expect(cluster.lose_node("n2") > 0, f"node n2 is lost while it works on task {task}")
    there = {p: p.stat().st_mtime_ns for p in shared.glob("labels/0*.json") if int(p.stem) % SHARDS == task - 1}
    expect(0 < len(there) < IMAGES // SHARDS, f"{len(there)} of the {IMAGES // SHARDS} images of its shard are there")
    return task, there


def dataset():
    folder = support.work_folder()
    recipe, local, shared = folder / "recipe.toml", folder / "local", folder / "shared 50%"
    recipe.write_text(f'[dataset]\nname = "bench"\nscene = "{support.SCENE}"\ncamera = "nav"\ntarget = "bay"\nset = {json.dumps(IMAGE)}\n')
    command = ["dataset", recipe, "-n", IMAGES]
    check_no_sbatch(*command, "-o", shared)
    slurm_nodes.check_installed()
    printed(*command, "-o", local)
    with slurm_nodes.Cluster() as cluster:
        narpa(*command, "-o", shared, "--on", "slurm:nowhere", status=3)
        on = [*command, "-o", shared, "--on", "slurm:both", "--max-jobs", SHARDS, "--sbatch", "--time=30 --comment='two words'"]
        waiting = subprocess.Popen([NARPA, *map(str, on), "--wait", "--json"], stdout=subprocess.PIPE, text=True)
        task, there = lose_node_in_the_middle(cluster, shared)
        narpa(*on, status=1)  # the jobs are in the queue still
        release(cluster)
        said = json.loads(waiting.communicate(timeout=WAIT_S)[0])
        expect(waiting.returncode == 0 and said["made"] == IMAGES and said["gathered"], f"the data set is complete: {said}")
        expect(not cluster.output("squeue", "-h"), "no job is left")
        log = (shared / f"slurm/part-{task}.log").read_text()
        expect(f"made {IMAGES // SHARDS - len(there)} of the {IMAGES // SHARDS} images" in log, f"only what was missing was made again: {log[-200:]}")
        expect(all(p.stat().st_mtime_ns == t for p, t in there.items()), "what was complete before was kept")
        expect_same(local, shared, "on two nodes, one of which was lost", files(local))

        jobs = (shared / "slurm/jobs").read_text()
        again = printed(*on, "--wait")
        expect(again["made"] == 0 and (shared / "slurm/jobs").read_text() == jobs, "given again, nothing is submitted")
        (shared / "masks/000006.png").unlink()
        said = printed(*on)
        expect(said["submitted"]["tasks"] == 1, f"a task for the shard that lacks an image: {said}")
        cluster.wait_for(lambda: not cluster.output("squeue", "-h"), "it ends")
        expect_same(local, shared, "with the lost mask", files(local))


def result_of(campaign, run):
    """A run's result; heartbeats are sent by wall time."""
    result = json.loads((campaign / f"runs/{run:04}/result.json").read_text())
    result["bus"].pop("heartbeats")
    return result


def rehearse():
    folder = support.work_folder()
    local, shared = folder / "local", folder / "shared"
    scenario = folder / "short.toml"
    scenario.write_text(f'[scenario]\nbased_on = "{SCENARIO}"\nname = "short"\nduration_s = 2.0\n')
    command = ["rehearse", scenario, "--runs", RUNS]
    check_no_sbatch(*command, "-o", shared)
    narpa(*command, "-o", shared, "--on", "slurm", "--can", "udp:239.74.163.2", status=2)
    slurm_nodes.check_installed()
    summary = printed(*command, "-o", local, status=1)  # the gate on the duration fails
    expect(len(summary["each"]) == RUNS, "a campaign on this machine")
    with slurm_nodes.Cluster() as cluster:
        on = [*command, "-o", shared, "--on", "slurm", "--max-jobs", 2, "--wait"]
        waiting = subprocess.Popen([NARPA, *map(str, on), "--json"], stdout=subprocess.PIPE, text=True)
        cluster.wait_for(lambda: task_on(cluster, "n2") and list(shared.glob("runs/*/emulator/can.log")), "a run is under way")
        time.sleep(1)
        task = task_on(cluster, "n2")
        expect(cluster.lose_node("n2") > 0, f"node n2 is lost while it flies runs of task {task}")
        release(cluster)
        said = json.loads(waiting.communicate(timeout=WAIT_S)[0])
        expect(waiting.returncode == 1 and said == summary, "the same summary as on this machine, and the same exit status")
        results = ["dynamics/truth.csv", "dynamics/dynamics.json", "navigation/navigation.csv", "emulator/can.log", "scenario.toml"]
        same = [f"runs/{k:04}/{name}" for k in range(1, RUNS + 1) for name in results] + ["summary.json", "junit.xml"]
        expect_same(local, shared, "on two nodes, one of which was lost", same)
        expect([result_of(shared, k) for k in range(1, RUNS + 1)] == [result_of(local, k) for k in range(1, RUNS + 1)], "and the results are equal")
        flown = {p: p.stat().st_mtime_ns for p in shared.glob("runs/*/result.json")}
        jobs = (shared / "slurm/jobs").read_text()
        expect(printed(*on, status=1) == summary and (shared / "slurm/jobs").read_text() == jobs, "given again, nothing is submitted")
        shutil.rmtree(shared / "runs/0002")
        cluster.start_node("n2")
        expect(printed(*on, status=1) == summary, "a run that was deleted is flown again")
        kept = {p: p.stat().st_mtime_ns for p in shared.glob("runs/*/result.json") if p.parent.name != "0002"}
        expect(len(kept) == RUNS - 1 and kept.items() <= flown.items(), "the others are not")
        expect_same(local, shared, "with the run that was deleted", same)


{"dataset": dataset, "rehearse": rehearse}[sys.argv[1]]()
