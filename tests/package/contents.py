"""Checks an installed tree: its files, its size, and that its programs start and find their files there.

Usage: contents.py PREFIX
"""
import os
import subprocess
import sys
from pathlib import Path

MOST_MB = 110  # measured: 101, of which the scenes are 35
IMPORT_EXAMPLE = """
import sys
sys.path = [sys.argv[1]] + [path for path in sys.path if "share/narpa" not in path]
try:
    import dynamics
except ModuleNotFoundError as error:
    if error.name.startswith("narpa"):
        raise
"""

prefix = Path(sys.argv[1])
share = prefix / "share/narpa"
wrong = []

for name in [
    "bin/narpa", "bin/narpa-dynamics", "bin/narpa-navigation", "bin/narpa-mesh-reader",
    "bin/narpa-bench", "bin/narpa-plot", "lib/narpa/narpa-image-codecs.so",
    "share/narpa/LICENSE", "share/narpa/README.md", "share/narpa/docs/scene.md", "share/narpa/docs/interfaces.md",
    "share/narpa/protocols/can/README.md", "share/narpa/protocols/can/narpa.dbc",
    "share/narpa/examples/dynamics.py", "share/narpa/python/narpa/can.py",
    "share/narpa/scenes/docking/docking.toml", "share/narpa/scenes/docking/station.obj",
    "share/narpa/scenes/rehearsal/docking.toml",
    "share/man/man1/narpa.1", "share/man/man1/narpa-render.1", "share/man/man1/narpa-navigation.1",
    "lib/systemd/system/narpa@.service", "lib/udev/rules.d/70-narpa-usb.rules",
]:  # fmt: skip
    if not (prefix / name).is_file():
        wrong.append(f"{name} is missing")
# The Python package with its compiled module, where pybind11 is installed.
packages = [path.parent for path in prefix.glob("lib/python3*/dist-packages/narpa") if list(path.glob("_narpa.*.so"))]
COMPILED = "import narpa; from narpa import dbc; dbc.read(); assert narpa.load_scene('cornell').render().dn.max() > 0"

if (prefix / "lib/libnarpa_bench.a").exists():
    wrong.append("lib/libnarpa_bench.a is installed, though nothing uses it")

page = (prefix / "share/man/man1/narpa-render.1").read_text()
for part in (".TH NARPA-RENDER 1", "\n.SH NAME\n", "\n.SH \"OPTIONS\"\n", "\\-\\-camera NAME"):
    if part not in page:
        wrong.append(f"narpa-render.1 has no {part!r}")


def completions(*words):
    """What bash offers for the last word."""
    script = """source "$0"; COMP_WORDS=("$@"); COMP_CWORD=$(($# - 1)); _narpa; printf '%s\\n' "${COMPREPLY[@]}" """
    ran = subprocess.run(["bash", "-c", script, prefix / "share/bash-completion/completions/narpa", prefix / "bin/narpa", *words],
                         cwd=prefix, capture_output=True, text=True)  # fmt: skip
    return ran.stdout.split()


for words, expected in [(["reh"], ["rehearse"]), (["render", "--came"], ["--camera"]), (["render", "corn"], ["cornell"])]:
    if completions(*words) != expected:
        wrong.append(f"completion of {words} offers {completions(*words)}, expected {expected}")

for program in (prefix / "bin").iterdir():
    if b".debug_info" in program.read_bytes():
        wrong.append(f"bin/{program.name} has debug information")

environment = {"PATH": "/usr/bin:/bin", "PYTHONPATH": str(share / "python"), "PYTHONDONTWRITEBYTECODE": "1"}
for command in [
    [prefix / "bin/narpa", "--version"],
    [prefix / "bin/narpa", "check", share / "scenes/cornell/cornell.toml"],
    [prefix / "bin/narpa-plot", "--help"],
    [sys.executable, "-c", "from narpa import dbc; dbc.read()"],
    [sys.executable, "-c", IMPORT_EXAMPLE, share / "examples"],
    *(["/usr/bin/env", f"PYTHONPATH={package}", sys.executable, "-c", COMPILED] for package in packages),
]:
    ran = subprocess.run(command, env=environment, cwd=prefix, capture_output=True, text=True)
    if ran.returncode:
        wrong.append(f"{' '.join(map(str, command))}: exit {ran.returncode}: {ran.stderr.strip()[-300:]}")

sizes = [os.lstat(path).st_size for path in prefix.rglob("*") if path.is_file()]
total = sum(sizes) / 1e6
if total > MOST_MB:
    wrong.append(f"{total:.0f} MB are installed, more than {MOST_MB}")
print("\n".join(wrong) or f"{len(sizes)} files, {total:.0f} MB")
sys.exit(bool(wrong))
