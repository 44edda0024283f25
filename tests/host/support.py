"""Helpers of the host and kernel tests: run narpa, command it over CAN, read its files.

Messages are encoded and decoded by the Python package (python/narpa, checked by tests/python) from the DBC file that narpa
writes, so that an error in narpa's own encoder is detected.
"""
import json
import os
import re
import signal
import socket
import subprocess
import sys
import tempfile
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "python"))

NARPA = os.environ["NARPA_BIN"]
SCENE = Path(__file__).resolve().parent / "scene/bench.toml"
BODY, CAN_ID, CAMERA, LIDAR = "chaser", 0x100, "nav", "top"  # names in that scene
WIDTH, HEIGHT, PERIOD_NS = 160, 120, 100_000_000
POSITION_PORT_OFFSET = 5940  # of a VLP-16: factory ports 2368 and 8308
PIXEL_BYTES = {"GREY": 1, "Y16": 2, "YUYV": 2, "RGB24": 3}


def skip(reason):
    print(f"SKIP: {reason}", flush=True)
    sys.exit(77)


def expect(condition, what):
    if not condition:
        print(f"FAILED: {what}", flush=True)
        sys.exit(1)
    print(f"ok: {what}", flush=True)


def work_folder():
    """A temporary folder, deleted when the script ends."""
    folder = tempfile.TemporaryDirectory(prefix="narpa-test-")
    work_folder.kept.append(folder)
    return Path(folder.name)


work_folder.kept = []


def enter_own_network(script, *arguments):
    """Runs the script with these arguments in a network namespace of its own, where only loopback exists."""
    unshare = ["unshare", "--net"] + ([] if os.geteuid() == 0 else ["--map-root-user"])
    if subprocess.run([*unshare, "ip", "link", "set", "lo", "up"], capture_output=True).returncode != 0:
        skip("this user may not make a network namespace (unshare --net)")
    os.execvp(unshare[0], [*unshare, sys.executable, script, *arguments])


def free_port():
    with socket.socket() as s:
        s.bind(("127.0.0.1", 0))
        return s.getsockname()[1]


def free_lidar_port():
    """A UDP port for data packets that is free, as is the VLP-16's position port above it. Both are below the range of ephemeral
    ports, so that no outgoing connection takes one of them."""
    for data in range(20_000 + os.getpid() % 1000, 26_000):
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as s, socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as t:
            try:
                s.bind(("127.0.0.1", data))
                t.bind(("127.0.0.1", data + POSITION_PORT_OFFSET))
                return data
            except OSError:
                continue
    raise OSError("no pair of free UDP ports on the loopback")


def scene_with(folder, pixel_format):
    """Copies the scene and its meshes to `folder`, with another pixel format of the camera; returns the scene's file."""
    text, changed = re.subn(r'^format = "\w+"', f'format = "{pixel_format}"', SCENE.read_text(), flags=re.M)
    assert changed == 1
    for file in SCENE.parent.iterdir():
        (folder / file.name).write_bytes(file.read_bytes())
    path = folder / f"bench_{pixel_format}.toml"
    path.write_text(text)
    return path


# --- narpa ----------------------------------------------------------------------------------------------------------


def narpa(*arguments, status=0):
    """Runs narpa and waits for it; fails unless its exit status is `status`, or with None 0 or 1. Returns its CompletedProcess."""
    done = subprocess.run([NARPA, *map(str, arguments)], capture_output=True, timeout=1800)
    if done.returncode != status and not (status is None and done.returncode in (0, 1)):
        print(done.stderr.decode(errors="replace"))
        expect(False, f"narpa {' '.join(map(str, arguments))} exits with {status}, not {done.returncode}")
    return done


class Run:
    """`narpa run` in the background. `stop` ends it as Ctrl-C does, unless it has already ended because its clients in
    lockstep have left, and returns its JSON summary."""

    def __init__(self, *arguments):
        self.log = work_folder() / "stderr"
        with open(self.log, "wb") as log:
            command = [NARPA, "run", *map(str, arguments), "--json"]
            self.process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=log)

    def __enter__(self):
        return self

    def __exit__(self, trouble, *_):
        status = self.process.poll()
        if status is None:
            self.process.kill()
            self.process.wait()
        if trouble:
            print(f"--- narpa run ({'still there' if status is None else f'ended with {status}'}) wrote to standard error:\n{self.stderr()}")

    def stderr(self):
        return self.log.read_text(errors="replace")

    def expect_alive(self):
        if self.process.poll() is not None:
            print(self.stderr())
            expect(False, f"narpa run is still running (it ended with {self.process.returncode})")

    def wait_for(self, pattern, seconds=600):
        """Waits for the pattern in narpa's standard error; returns the first match."""
        for _ in range(int(seconds * 20)):
            if match := re.search(pattern, self.stderr()):
                return match
            self.expect_alive()
            time.sleep(0.05)
        print(self.stderr())
        expect(False, f"narpa run says {pattern} within {seconds} s")

    def finish(self, seconds=600):
        """Waits until narpa ends by itself."""
        out, _ = self.process.communicate(timeout=seconds)
        if self.process.returncode != 0:
            print(self.stderr())
            expect(False, f"narpa run exits with 0, not {self.process.returncode}")
        return json.loads(out)

    def stop(self):
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGINT)
        return self.finish()


def render(scene, frame, pose, folder):
    """The bytes that a video device receives for the frame at time frame * period with the body at `pose`."""
    path = folder / f"frame_{frame}.raw"
    numbers = ",".join(repr(v) for v in (*pose.position, *pose.attitude))
    narpa("render", scene, "--camera", CAMERA, "--frame", frame, "--time", repr(frame * PERIOD_NS * 1e-9),
          "--pose", f"{BODY}={numbers}", "-o", path)
    return path.read_bytes()


# --- poses on CAN ---------------------------------------------------------------------------------------------------


class Pose:
    """A pose with values rounded to the resolution of the signals in the DBC. World frame, metres; (w, x, y, z)."""

    STEPS = {"Position": 1e-6, "Attitude": 2.0**-22, "Velocity": 2e-5, "Rate": 2e-5}

    def __init__(self, position, attitude, velocity=(0, 0, 0), rate=(0, 0, 0)):
        norm = sum(v * v for v in attitude) ** 0.5
        given = {"Position": position, "Attitude": [v / norm for v in attitude], "Velocity": velocity, "Rate": rate}
        self.signals = {name: [round(v / self.STEPS[name]) * self.STEPS[name] for v in values] for name, values in given.items()}
        self.position = tuple(self.signals["Position"])
        q = self.signals["Attitude"]
        scale = 1.0 / (q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]) ** 0.5
        self.attitude = tuple(v * scale for v in q)


def flight(count):
    """Poses of a chaser that drifts and rotates in front of the scene's bodies."""
    return [
        Pose((0.05 * i, -0.03 * i, 0.08 * i), (1, 0.004 * i, -0.01 * i, 0.006 * i), (0.5, -0.3, 0.8), (0.08, -0.2, 0.12))
        for i in range(count)
    ]


class Wire:
    """Encodes pose commands and decodes telemetry as python-can messages, with the DBC file that narpa writes for the scene."""

    def __init__(self):
        from narpa.can import Catalogue, Decoder

        dbc = work_folder() / "bench.dbc"
        narpa("check", SCENE, "--dbc", dbc)
        self.catalogue = Catalogue(dbc)
        self.decoder = Decoder(self.catalogue)

    def command(self, pose, t_ns, counter, fd=False):
        """The messages of one pose command: nine classic ones, or one of CAN FD."""
        import can

        frames = self.catalogue.at("Pose", CAN_ID).encode({"Time": t_ns, **pose.signals}, counter, fd)
        return [can.Message(arbitration_id=i, is_extended_id=False, data=data, is_fd=fd) for i, data in frames]

    def accept(self, message):
        """The set of signals that this message completes, or None."""
        return self.decoder.accept(message.arbitration_id, message.data)


def await_ledger(bus, wire, frame, seconds=30):
    """Reads the bus until the ledger of `frame` arrives, and returns it."""
    until = time.monotonic() + seconds
    while time.monotonic() < until:
        message = bus.recv(0.2)
        received = message and wire.accept(message)
        if received and received.name == "Ledger" and received["Frame"] == frame:
            return received
    expect(False, f"the ledger of frame {frame} arrives within {seconds} s")


def command_frames(run, port, poses, pause_s=0):
    """Commands a run in lockstep over slcan at `port`, one pose for each frame, and pauses after each; returns when it has made the
    last one."""
    wire = Wire()
    bus = open_bus(run, interface="slcan", channel=f"socket://127.0.0.1:{port}", sleep_after_open=0.1)
    for frame, pose in enumerate(poses):
        for message in wire.command(pose, frame * PERIOD_NS, counter=frame):
            bus.send(message)
        await_ledger(bus, wire, frame)
        time.sleep(pause_s)
    bus.shutdown()


def open_bus(run, seconds=30, **settings):
    """Opens a python-can bus after narpa has. On a bus without a server, commands sent earlier would be lost."""
    import can

    run.wait_for("commands: ")
    until = time.monotonic() + seconds
    while True:
        run.expect_alive()
        try:
            return can.Bus(**settings)
        except Exception:  # the type of the exception depends on the interface
            if time.monotonic() > until:
                raise
            time.sleep(0.1)


# --- files ----------------------------------------------------------------------------------------------------------


def read_y4m(path):
    """The samples of every frame of a Y4M file."""
    from narpa import y4m

    return list(iter(y4m.Reader(path).read_bytes, None))


def expect_frames(got, wanted, what):
    expect(len(got) == len(wanted), f"{what}: {len(got)} frames, expected {len(wanted)}")
    for i, (a, b) in enumerate(zip(got, wanted)):
        if a != b:
            differing = sum(x != y for x, y in zip(a, b))
            expect(False, f"{what}: frame {i} differs in {differing} of {len(b)} bytes (sizes {len(a)}, {len(b)})")
    distinct = len(set(wanted))
    expect(distinct == len(wanted), f"{what}: {len(got)} frames byte-identical to narpa render, {distinct} distinct")
