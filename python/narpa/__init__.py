"""narpa for Python. Its compiled module renders, scans and estimates within the process:

    narpa.load_scene   a scene: render to NumPy arrays, scan, place bodies and cameras
    narpa.estimate     the pose of a target from a frame or a sweep, with covariance and Cramer-Rao bound
    narpa.Emulator     the emulator in lockstep: poses in, frames, sweeps and ledgers out
    narpa.Error        what is refused; narpa.SceneError has file, line and column

Pure Python, for programs that meet narpa on the wire or in files:

    narpa.can       open a bus, send and receive pose commands and all other messages by their names in narpa.dbc
    narpa.dbc       DBC files: messages, signals, encoding
    narpa.y4m       video streams, as `narpa run --video CAMERA=FILE.y4m` writes them
    narpa.datagrams frames in UDP datagrams, as `narpa run --video CAMERA=udp:HOST:PORT` sends them
    narpa.rtp       frames in RTP packets (RFC 4175), as `narpa run --video CAMERA=rtp:HOST:PORT,sdp=FILE` sends them
    narpa.vlp16     VLP-16 data packets, as `narpa run --lidar LIDAR=udp:HOST:PORT` sends them
    narpa.points    packets of LiDARs that are described by a file
    narpa.pcap      UDP datagrams of a capture
    narpa.ouster    lidar packets of Ouster sensors, decoded with the sensor's metadata
    narpa.logs      what a run has logged
    narpa.rotation  quaternions (w, x, y, z)
    narpa.toml      dictionaries as scene files
    narpa.plots     the plots of narpa's commands (needs matplotlib)

python/README.md shows how to use them; examples/ has whole programs.
"""
from .errors import Error, SceneError

# Names of the compiled module, loaded when they are first used: the pure modules work without it.
_COMPILED = {
    "load_scene": "scenes", "Scene": "scenes", "Frame": "scenes", "CameraInfo": "scenes",
    "Emulator": "emulation", "EmulatedFrame": "emulation", "EmulatedSweep": "emulation", "Step": "emulation",
    "estimate": "estimation", "Estimate": "estimation",
}  # fmt: skip
__all__ = ["Error", "SceneError", *_COMPILED]


def __getattr__(name):
    if name not in _COMPILED:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module

    return getattr(import_module(f"{__name__}.{_COMPILED[name]}"), name)


def __dir__():
    return sorted({*globals(), *_COMPILED})
