"""Scenes that are rendered and scanned within Python: narpa.load_scene."""
import os
from collections.abc import Mapping
from pathlib import Path

from . import toml
from .compiled import _narpa

Scene = _narpa.Scene
Frame = _narpa.Frame
CameraInfo = _narpa.CameraInfo
for kind in (Scene, Frame, CameraInfo):
    kind.__module__ = "narpa"
DICTIONARY = "<dict>"  # the name of a dictionary in errors


def arguments_of(source, folder):
    """(file or name, text or None) of what the user calls a scene."""
    if isinstance(source, Mapping):
        return str(Path(folder) / DICTIONARY), toml.dumps(source)
    return os.fspath(source), None


def load_scene(source, overrides=None, *, folder=".", threads=0):
    """Reads a scene and builds its renderer. Returns a narpa.Scene.

    source: a scene file, the name of one that comes with narpa ("docking"), or a dict with the keys of a scene file:
        {"sun": {"direction": [1, 0, 0]}, "body": [{...}], "camera": [{...}]}.
    overrides: values of single keys in place of the scene's, {"camera.nav.detector.exposure_s": 0.002}, as `--set`.
    folder: where names of files in a dict start.
    threads: threads that trace rays; 0: one per core. The smallest of all scenes of a process holds.

    Raises narpa.SceneError with file, line and column. Those of a dict count in narpa.toml.dumps(source).
    """
    name, text = arguments_of(source, folder)
    sets = toml.overrides_of(overrides)
    return Scene.load(name, sets, threads) if text is None else Scene.parse(text, name, sets, threads)
