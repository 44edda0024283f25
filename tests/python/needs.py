"""Skips a test file whose modules are not installed: `needs.modules("can", "numpy")` before they are imported."""
import importlib.util
import sys


def modules(*names):
    missing = [name for name in names if importlib.util.find_spec(name) is None]
    if missing:
        print(f"SKIP: not installed: {', '.join(missing)} (scripts/setup test)")
        sys.exit(77)


def compiled():
    """Skips unless narpa's compiled module was built."""
    modules("numpy")
    try:
        import narpa.compiled  # noqa: F401
    except ImportError as error:
        print(f"SKIP: {error}")
        sys.exit(77)
