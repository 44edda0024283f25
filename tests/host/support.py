"""What the scripts of the host and kernel tiers share: running narpa, speaking its CAN protocol, reading its files.

Poses are encoded here from the DBC file by canmatrix and from the documented checksums, not by narpa's own code, so
that a mistake in that code does not cancel out.
"""
import json
import logging
import os
import re
import signal
import socket
import subprocess
import sys
import tempfile
import time
from decimal import Decimal
from pathlib import Path

NARPA = os.environ["NARPA_BIN"]
SCENE = Path(__file__).resolve().parent / "scene/bench.toml"
BODY, CAN_ID, CAMERA, LIDAR = "chaser", 0x100, "nav", "top"  # of that scene
WIDTH, HEIGHT, PERIOD_NS = 160, 120, 100_000_000
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
    """A folder that is gone when the script ends."""
    folder = tempfile.TemporaryDirectory(prefix="narpa-test-")
    work_folder.kept.append(folder)
    return Path(folder.name)


work_folder.kept = []


def free_port():
    with socket.socket() as s:
        s.bind(("127.0.0.1", 0))
        return s.getsockname()[1]


def scene_with(folder, pixel_format):
    """The scene's file with its camera's pixel format replaced, in `folder`, with its meshes beside it."""
    text, changed = re.subn(r'^format = "\w+"', f'format = "{pixel_format}"', SCENE.read_text(), flags=re.M)
    assert changed == 1
    for file in SCENE.parent.iterdir():
        (folder / file.name).write_bytes(file.read_bytes())
    path = folder / f"bench_{pixel_format}.toml"
    path.write_text(text)
    return path


# --- narpa ----------------------------------------------------------------------------------------------------------


def narpa(*arguments, status=0):
    """Runs narpa to its end; fails unless it ends with `status`. Returns what it did and said."""
    done = subprocess.run([NARPA, *map(str, arguments)], capture_output=True, timeout=120)
    if done.returncode != status:
        print(done.stderr.decode(errors="replace"))
        expect(False, f"narpa {' '.join(map(str, arguments))} exits with {status}, not {done.returncode}")
    return done


class Run:
    """`narpa run` in the background. `stop` ends it as Ctrl-C does and returns its JSON summary."""

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
            print(f"--- narpa run ({'still there' if status is None else f'ended with {status}'}) said:\n{self.said()}")

    def said(self):
        return self.log.read_text(errors="replace")

    def expect_alive(self):
        if self.process.poll() is not None:
            print(self.said())
            expect(False, f"narpa run is still running (it ended with {self.process.returncode})")

    def wait_for(self, pattern, seconds=60):
        """The first match of the pattern in what narpa says."""
        for _ in range(int(seconds * 20)):
            if match := re.search(pattern, self.said()):
                return match
            self.expect_alive()
            time.sleep(0.05)
        print(self.said())
        expect(False, f"narpa run says {pattern} within {seconds} s")

    def finish(self, seconds=60):
        """Waits until it ends by itself."""
        out, _ = self.process.communicate(timeout=seconds)
        if self.process.returncode != 0:
            print(self.said())
            expect(False, f"narpa run exits with 0, not {self.process.returncode}")
        return json.loads(out)

    def stop(self):
        self.expect_alive()
        self.process.send_signal(signal.SIGINT)
        return self.finish()


def render(scene, frame, pose, folder):
    """The bytes that a video device gets for a frame at the time frame * period, the body being at `pose`."""
    path = folder / f"frame_{frame}.raw"
    numbers = ",".join(repr(v) for v in (*pose.position, *pose.attitude))
    narpa("render", scene, "--camera", CAMERA, "--frame", frame, "--time", repr(frame * PERIOD_NS * 1e-9),
          "--pose", f"{BODY}={numbers}", "-o", path)
    return path.read_bytes()


# --- poses on CAN ---------------------------------------------------------------------------------------------------


class Pose:
    """A pose as the wire can carry it: what is given, rounded to the DBC's factors. World frame, metres; (w, x, y, z)."""

    POSITION, ATTITUDE, VELOCITY, RATE = Decimal("1e-6"), Decimal(2) ** -22, Decimal("2e-5"), Decimal("2e-5")

    def __init__(self, position, attitude, velocity=(0, 0, 0), rate=(0, 0, 0)):
        norm = sum(v * v for v in attitude) ** 0.5
        self.raw = {}
        for name, axes, values, factor in (
            ("Position", "XYZ", position, self.POSITION),
            ("Attitude", "WXYZ", [v / norm for v in attitude], self.ATTITUDE),
            ("Velocity", "XYZ", velocity, self.VELOCITY),
            ("Rate", "XYZ", rate, self.RATE),
        ):
            for axis, value in zip(axes, values):
                self.raw[name + axis] = round(value / float(factor))
        self.position = tuple(self.raw["Position" + a] * 1e-6 for a in "XYZ")
        q = [self.raw["Attitude" + a] * 2.0**-22 for a in "WXYZ"]
        scale = 1.0 / (q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]) ** 0.5
        self.attitude = tuple(v * scale for v in q)

    def physical(self):
        factors = {"P": self.POSITION, "A": self.ATTITUDE, "V": self.VELOCITY, "R": self.RATE}
        return {name: raw * factors[name[0]] for name, raw in self.raw.items()}


def flight(count):
    """Ten or so poses of a chaser that drifts and turns before the scene's bodies."""
    return [
        Pose((0.05 * i, -0.03 * i, 0.08 * i), (1, 0.004 * i, -0.01 * i, 0.006 * i), (0.5, -0.3, 0.8), (0.08, -0.2, 0.12))
        for i in range(count)
    ]


def crc8_j1850(data):
    crc = 0xFF
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = (crc << 1 ^ 0x1D if crc & 0x80 else crc << 1) & 0xFF
    return crc ^ 0xFF


def crc16_ccitt_false(data):
    crc = 0xFFFF
    for byte in data:
        crc ^= byte << 8
        for _ in range(8):
            crc = (crc << 1 ^ 0x1021 if crc & 0x8000 else crc << 1) & 0xFFFF
    return crc


class Wire:
    """Pose commands and telemetry of the scene as python-can messages, laid out by its DBC."""

    def __init__(self):
        logging.getLogger("canmatrix").setLevel(logging.CRITICAL)  # of the formats that it would read, too
        import canmatrix.formats

        dbc = work_folder() / "bench.dbc"
        narpa("check", SCENE, "--dbc", dbc)
        database = canmatrix.formats.loadp_flat(str(dbc))
        self.frames = {frame.arbitration_id.id: frame for frame in database.frames}

    def _encode(self, identifier, values):
        frame = self.frames[identifier]
        return bytearray(frame.encode({s.name: s.phys2raw(values[s.name]) for s in frame.signals if s.name in values}))

    def command(self, pose, t_ns, counter, fd=False):
        """The messages of one pose command: nine classic ones, or one of CAN FD."""
        import can

        values = pose.physical() | {"Time": Decimal(t_ns), "Counter": Decimal(counter % 256)}
        messages = []
        for offset in [15] if fd else range(9):
            identifier = CAN_ID + offset
            data = self._encode(identifier, values)
            id_bytes = identifier.to_bytes(2, "little")
            if fd:
                data[62:] = crc16_ccitt_false(id_bytes + data[:62]).to_bytes(2, "little")
            else:
                data[7] = crc8_j1850(id_bytes + data[:7])
            messages.append(can.Message(arbitration_id=identifier, is_extended_id=False, data=data, is_fd=fd))
        return messages

    def decode(self, message):
        """{signal: value} of a message of narpa's, or nothing for an identifier that the DBC does not have."""
        frame = self.frames.get(message.arbitration_id)
        return {k: v.phys_value for k, v in frame.decode(bytearray(message.data)).items()} if frame else {}


LEDGER_FRAME, LEDGER_FD, HEARTBEAT = 0x600, 0x60F, 0x701


def await_ledger(bus, wire, frame, seconds=30):
    """Reads the bus until narpa tells that it has handed over `frame`; returns the signals of that message."""
    until = time.monotonic() + seconds
    while time.monotonic() < until:
        message = bus.recv(0.2)
        if message and message.arbitration_id in (LEDGER_FRAME, LEDGER_FD):
            signals = wire.decode(message)
            if signals["Frame"] == frame:
                return signals
    expect(False, f"the ledger of frame {frame} comes within {seconds} s")


def open_bus(run, seconds=30, **settings):
    """A python-can bus, as soon as narpa listens: on a bus without a server, nobody would notice a command too early."""
    import can

    run.wait_for("commands: ")
    until = time.monotonic() + seconds
    while True:
        run.expect_alive()
        try:
            return can.Bus(**settings)
        except Exception:  # which one depends on the interface
            if time.monotonic() > until:
                raise
            time.sleep(0.1)


# --- files ----------------------------------------------------------------------------------------------------------


def read_y4m(path_or_bytes, frame_bytes):
    """(header, [frames]) of a YUV4MPEG2 file; every frame must be whole."""
    data = path_or_bytes if isinstance(path_or_bytes, bytes) else Path(path_or_bytes).read_bytes()
    header, _, rest = data.partition(b"\n")
    frames = []
    while rest:
        line, _, rest = rest.partition(b"\n")
        assert line.startswith(b"FRAME") and len(rest) >= frame_bytes, "a broken frame in the Y4M file"
        frames.append(rest[:frame_bytes])
        rest = rest[frame_bytes:]
    return header.decode(), frames


def expect_frames(got, wanted, what):
    expect(len(got) == len(wanted), f"{what}: {len(got)} frames, expected {len(wanted)}")
    for i, (a, b) in enumerate(zip(got, wanted)):
        if a != b:
            differing = sum(x != y for x, y in zip(a, b))
            expect(False, f"{what}: frame {i} differs in {differing} of {len(b)} bytes (sizes {len(a)}, {len(b)})")
    distinct = len(set(wanted))
    expect(distinct == len(wanted), f"{what}: {len(got)} frames byte-identical to narpa render, {distinct} distinct")
