"""The program narpa and the scene of the host tests, for tests that compare it with the compiled module."""
import json
import os
import subprocess
from pathlib import Path

NARPA = os.environ.get("NARPA_BIN", "narpa")
SCENE = Path(__file__).resolve().parents[1] / "host/scene/bench.toml"
POSE = (0.1, -0.05, 0.2), (0.9961946980917455, 0, 0.08715574274765817, 0)


def pose_option(body, pose):
    return f"{body}=" + ",".join(repr(float(v)) for part in pose for v in part)


def narpa(*arguments):
    """Runs narpa; returns the document of --json, or None."""
    done = subprocess.run([NARPA, *map(str, arguments)], capture_output=True, text=True)
    assert done.returncode in (0, 1), done.stderr
    return json.loads(done.stdout) if "--json" in arguments else None
