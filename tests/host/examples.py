#!/usr/bin/python3
"""The programs of examples/: dynamics.py and navigation.py close the loop around `narpa run`, emulator.py replaces it."""
import os
import subprocess
import sys
from pathlib import Path

import support
from support import expect

try:
    import can, cv2, msgpack, serial  # noqa: F401: needed by the examples
except ImportError as error:
    support.skip(f"{error} (python3-can, python3-msgpack, python3-opencv, python3-serial)")

BUILD, SOURCE = Path(os.environ["NARPA_BUILD_DIR"]), Path(__file__).resolve().parents[2]
SCENES, GROUP = BUILD / "scenes/rehearsal", f"239.74.198.{1 + os.getpid() % 250}"
EXAMPLES = SOURCE / "examples"
folder = support.work_folder()


def started(name, *command):
    """Starts a program in the background and waits until it has printed "ready"; returns it and the file with its output."""
    out = folder / f"{name}.out"
    process = subprocess.Popen([str(c) for c in command], stdout=open(out, "wb"), stderr=subprocess.STDOUT)
    for _ in range(600):
        if "ready" in out.read_text(errors="replace"):
            return process, out
        if process.poll() is not None:
            break
        support.time.sleep(0.1)
    process.kill()
    expect(False, f"{name} prints ready; its output: {out.read_text(errors='replace')}")


def finished(name, process, out):
    try:
        status = process.wait(timeout=600)
    except subprocess.TimeoutExpired:
        process.kill()
        status = "(does not end)"
    if status != 0:
        print(out.read_text(errors="replace"))
    expect(status == 0, f"{name} ends well: {status}")
    return out.read_text(errors="replace")


def check_dynamics_and_navigation(seconds):
    fifo = folder / "nav"
    os.mkfifo(fifo)
    with support.Run(SCENES / "scene.toml", "--can", "slcan:0", "--video", f"nav={fifo}", "--lockstep") as run:
        channel = "slcan:" + run.wait_for(r"commands: slcan: 127\.0\.0\.1:(\d+) ")[1]
        navigation = started("navigation", sys.executable, EXAMPLES / "navigation.py", channel, fifo, "0")
        done = subprocess.run([sys.executable, EXAMPLES / "dynamics.py", channel, str(seconds)], capture_output=True,
                              text=True, timeout=1200)
        expect(done.returncode == 0, f"dynamics.py ends well: {done.returncode} {done.stderr[-500:]}")
        expect(len(done.stdout.splitlines()) == seconds, f"it was commanded {seconds} times: {done.stdout[-300:]}")
        output = finished("navigation.py", *navigation)
        expect(f"{seconds - 1}: off by" in output, "it commanded every period")
        summary = run.finish()  # ends by itself when the dynamics have disconnected
        expect(summary["can"]["interface_down"] == 0, "and clients that end are no fault")


def check_emulator(seconds):
    fifo, scenario = folder / "black", folder / "short.toml"
    os.mkfifo(fifo)
    scenario.write_text(f"""[scenario]\nbased_on = "{SCENES}/docking-camera.toml"\nname = "short"
scene = "{SCENES}/scene.toml"\nduration_s = {seconds}.0\n""")
    emulator = started("emulator", sys.executable, EXAMPLES / "emulator.py", f"udp:{GROUP}", fifo)
    bus = ["--can", f"udp:{GROUP}", "--lockstep"]
    navigation = started("narpa-navigation", BUILD / "bin/narpa-navigation", scenario, *bus, "--video", f"nav={fifo}")
    done = subprocess.run([BUILD / "bin/narpa-dynamics", scenario, *bus, "--patience", "60"], capture_output=True,
                          text=True, timeout=1200)
    expect(done.returncode == 0, f"narpa-dynamics ends well: {done.returncode} {done.stderr[-500:]}")
    finished("narpa-navigation", *navigation)
    output = finished("emulator.py", *emulator)
    expect(f"{seconds}.00 s, {seconds + 1} frames" in output, f"{seconds + 1} frames were handed over")


check_dynamics_and_navigation(8)
check_emulator(8)
