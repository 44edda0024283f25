"""Reads what narpa writes: the log of a run, a rehearsal, a scenario, the calibration of a scene's sensors.

    run = Run("out/first-flight")             # of `narpa run --log` or `narpa rehearse`
    run.ledger("nav")["t_exposure_mid_ns"]    # a NumPy array with a named column for each of the file
    run.truth("nav").at(1_000_000_000, "station")
    for t_s, message in run.messages(): ...   # of the CAN bus, decoded

Every function raises a ValueError that names file and line for what it cannot read.
"""
import csv
import json
from pathlib import Path

import numpy as np

from .can import Catalogue, Decoder
from .rotation import conjugate, product, rotate

try:
    import tomllib
except ImportError:  # Python before 3.11
    tomllib = None


def _cell(text):
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            pass
    return text


def read_table(path):
    """A CSV file with a header line as a NumPy structured array: integers, floats or texts, by column."""
    with open(path, newline="", encoding="utf-8") as file:
        rows = csv.reader(file)
        header = next(rows, None)
        if not header:
            raise ValueError(f"{path}:1: empty, expected a header line")
        cells = []
        for row in rows:
            if len(row) != len(header):
                raise ValueError(f"{path}:{rows.line_num}: {len(row)} columns, expected {len(header)}")
            cells.append([_cell(text) for text in row])
    columns = [np.array(column) for column in zip(*cells)] or [np.empty(0)] * len(header)
    table = np.empty(len(cells), [(name, column.dtype) for name, column in zip(header, columns)])
    for name, column in zip(header, columns):
        table[name] = column
    return table


class Poses:
    """Poses by time and body: positions in m and attitudes (w, x, y, z), body to world."""

    def __init__(self, table):
        """`table`: of a file with the columns t_s, body, x_m, y_m, z_m, qw, qx, qy, qz: a truth log or a trajectory."""
        self._of = {}
        for row in table:
            pose = np.array([row[k] for k in ("x_m", "y_m", "z_m")]), np.array([row[k] for k in ("qw", "qx", "qy", "qz")])
            self._of[round(float(row["t_s"]) * 1e9), str(row["body"])] = pose

    def at(self, t_ns, body):
        """(position, attitude) at exactly this time; a KeyError if the file has none."""
        return self._of[int(t_ns), body]

    def relative(self, t_ns, of, seen_from):
        """(position, attitude) of one body in the axes of another."""
        position, attitude = self.at(t_ns, of)
        origin, axes = self.at(t_ns, seen_from)
        return rotate(conjugate(axes), position - origin), product(conjugate(axes), attitude)

    def times_ns(self):
        return sorted({t for t, _ in self._of})


def read_candump(path):
    """(time in s, identifier, data) of each data frame in a candump log (`candump -l`, can.log)."""
    with open(path, encoding="ascii") as file:
        for number, line in enumerate(file, 1):
            if not line.strip():
                continue
            try:
                stamp, _, frame = line.split()[:3]
                identifier, _, data = frame.partition("#")
                if data.startswith("#"):  # CAN FD: a digit of flags
                    data = data[2:]
                if data.startswith("R"):
                    continue
                yield float(stamp.strip("()")), int(identifier, 16), bytes.fromhex(data.partition("_")[0])
            except ValueError:
                raise ValueError(f"{path}:{number}: expected (SECONDS) INTERFACE ID#DATA, got {line.strip()!r}") from None


def messages(path, dbc=None):
    """(time in s, message) of each complete message in a candump log. `dbc`: a scene's, by `narpa check SCENE --dbc`."""
    decoder = Decoder(Catalogue(dbc) if dbc else Catalogue())
    for t_s, identifier, data in read_candump(path):
        message = decoder.accept(identifier, data)
        if message:
            yield t_s, message


class Run:
    """The folder of `narpa run --log`, or of a rehearsal, whose emulator/ is such a folder."""

    def __init__(self, folder):
        self.folder = Path(folder)
        self.log = self.folder / "emulator" if (self.folder / "rehearsal.json").exists() else self.folder
        if not (self.log / "run.json").exists():
            raise ValueError(f"{self.log}/run.json: no such file, expected the log of a run")

    def ledger(self, camera):
        """A row for each frame of the camera; docs/replay.md has the columns."""
        return read_table(self.log / f"{camera}.ledger.csv")

    def sweeps(self, lidar):
        """A row for each sweep of the LiDAR."""
        return read_table(self.log / f"{lidar}.sweeps.csv")

    def truth(self, camera):
        """The poses of all bodies at the middle of each exposure."""
        return Poses(read_table(self.log / f"{camera}.truth.csv"))

    def messages(self, dbc=None):
        return messages(self.log / "can.log", dbc)

    def calibration(self):
        """{name: Sensor} of the scene's cameras and LiDARs. Like marks() and scenario(), of a run that has started, too."""
        return read_calibration(self.log / "calibration.json")

    def marks(self, body=None):
        """[Mark, ...] of all bodies, or of one."""
        return read_marks(self.log / "calibration.json", body)

    def record(self):
        """run.json: scene, settings, the files that the scene was read from."""
        return json.loads((self.log / "run.json").read_text())

    def result(self):
        """result.json of a rehearsal: the verdict."""
        return json.loads((self.folder / "result.json").read_text())

    def scenario(self):
        """The scenario that was flown, with all that it is based on."""
        return read_toml(self.folder / "scenario.toml")

    def scene(self):
        return read_toml(self.log / "scene.toml")


def read_toml(path):
    """A scene or scenario as dictionaries and lists. `based_on` is not followed: a run's copies have it merged."""
    if tomllib is None:
        raise ValueError("TOML needs Python 3.11 or later")
    try:
        return tomllib.loads(Path(path).read_text(encoding="utf-8"))
    except tomllib.TOMLDecodeError as error:
        raise ValueError(f"{path}: {error}") from None


class Sensor:
    """A camera or LiDAR of calibration.json: its entries by name, and its mounting."""

    def __init__(self, entries):
        self.entries = entries
        self.name, self.mount = entries["name"], entries["mount"]
        self.position_m = np.array(entries["position_m"])
        self.attitude = np.array(entries["attitude_wxyz"])

    def __getitem__(self, key):
        return self.entries[key]

    def from_mount(self, point_m):
        """A point of the body that it is mounted on, in the sensor's axes."""
        return rotate(conjugate(self.attitude), np.asarray(point_m, float) - self.position_m)

    @property
    def matrix(self):
        """fx, fy, cx, cy as a 3 x 3 matrix, for OpenCV."""
        return np.array(self.entries["camera_matrix"], float)

    @property
    def distortion(self):
        """For OpenCV."""
        return np.array(self.entries["distortion_coefficients"], float)


class Mark:
    """A lamp, reflector or tag of calibration.json, in the axes of its body."""

    def __init__(self, entries):
        self.entries = entries
        self.name, self.body, self.kind = entries["name"], entries["body"], entries["kind"]
        self.position_m = np.array(entries["position_m"], float)

    def __getitem__(self, key):
        return self.entries[key]

    @property
    def corners_m(self):
        """4 x 3: corners of a tag's black square, clockwise from the top left of its image, as detectors return them."""
        half = self.entries["side_m"] / 2
        corners = np.array([[-1, 1, 0], [1, 1, 0], [1, -1, 0], [-1, -1, 0]]) * half
        return np.array([self.position_m + rotate(self.entries["attitude_wxyz"], corner) for corner in corners])


def read_marks(path, body=None):
    """[Mark, ...] of calibration.json, of all bodies or of one."""
    return _read(path, lambda document: [Mark(m) for m in document["marks"] if body in (None, m["body"])])


def read_calibration(path):
    """{name: Sensor} of calibration.json, which `narpa check SCENE --calibration DIR` and `narpa run --log DIR` write."""
    return _read(path, lambda document: {s["name"]: Sensor(s) for s in document["cameras"] + document["lidars"]})


def _read(path, take):
    try:
        return take(json.loads(Path(path).read_text(encoding="utf-8")))
    except (json.JSONDecodeError, KeyError, TypeError) as error:
        raise ValueError(f"{path}: expected the calibration.json of `narpa check --calibration`: {error}") from None
