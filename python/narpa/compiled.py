"""The compiled module, or why it is not there."""
from importlib import import_module

try:
    _narpa = import_module("._narpa", __package__)
except ModuleNotFoundError as error:
    if error.name != f"{__package__}._narpa":
        raise
    raise ImportError(
        "narpa's compiled module is not here. Set PYTHONPATH to build/release/python of a built narpa, or to "
        "PREFIX/lib/python3.*/dist-packages of an installed one, and use the Python that it was built for (/usr/bin/python3). "
        "It is built where pybind11-dev and python3-dev are installed (scripts/setup)."
    ) from error
__all__ = ["_narpa"]
