"""Instructions per primary ray of the direct path: counted by callgrind, held against direct_path.json.

    count.py check  --narpa BIN --scene craft.toml ...   exit status 1 beyond the margin, 77 where it cannot be counted
    count.py renew  (the same)                           writes what is counted into direct_path.json

Counted is narpa::CameraRenderer::render of one frame of the craft on one thread, without loading, detector and file.
callgrind knows no AVX-512, so these are the AVX2 variants; other compilers and Embrees count otherwise, so numbers are
compared only where these are the ones that they were taken with.
"""

import argparse
import json
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile

NUMBERS = pathlib.Path(__file__).with_name("direct_path.json")
SIZE = 128  # px a side
MARGIN = 0.02
SKIPPED = 77


def skip(why):
    print("skipped: " + why)
    sys.exit(SKIPPED)


def small_scene(scene, folder, spp):
    """The scene with SIZE x SIZE pixels and so many samples."""
    text = pathlib.Path(scene).read_text()
    text, sizes = re.subn(r"resolution = \[\d+, \d+\]", f"resolution = [{SIZE}, {SIZE}]", text)
    text, samples = re.subn(r"(?m)^spp = \d+", f"spp = {spp}", text)
    if sizes == 0 or samples != 1:
        sys.exit(f"{scene}: expected cameras with a resolution and one spp")
    for mesh in pathlib.Path(scene).parent.glob("craft.[om]*"):
        (folder / mesh.name).symlink_to(mesh.resolve())
    path = folder / f"spp{spp}.toml"
    path.write_text(text)
    return path


def instructions(narpa, scene, folder):
    out = folder / "callgrind.out"
    done = subprocess.run(
        ["valgrind", "--tool=callgrind", "--collect-atstart=no",
         "--toggle-collect=narpa::CameraRenderer::render(*)", f"--callgrind-out-file={out}",
         narpa, "render", str(scene), "--threads", "1", "-o", str(folder / "x.png")],
        capture_output=True, text=True)
    if done.returncode != 0:
        sys.exit(f"narpa under valgrind ended with {done.returncode}:\n{done.stderr[-2000:]}")
    collected = re.search(r"Collected : (\d+)", done.stderr)
    if not collected or int(collected[1]) == 0:
        sys.exit("callgrind counted nothing: is narpa::CameraRenderer::render still the frame's function?")
    return int(collected[1])


def count(args):
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        scenes = {}
        for spp in (1, 4):
            (folder / str(spp)).mkdir()
            scenes[spp] = small_scene(args.scene, folder / str(spp), spp)
        return {f"{spp} spp": round(instructions(args.narpa, scene, scene.parent) / (SIZE * SIZE * spp), 2)
                for spp, scene in scenes.items()}


def tools(args):
    valgrind = subprocess.run(["valgrind", "--version"], capture_output=True, text=True).stdout.strip()
    linked = subprocess.run(["ldd", args.narpa], capture_output=True, text=True).stdout
    embree = re.search(r"libembree\S*", linked)
    library = re.search(r"libembree\S* => (\S+)", linked)
    version = pathlib.Path(library[1]).resolve().name if library else (embree[0] if embree else "linked statically")
    return {"valgrind": valgrind, "compiler": args.compiler, "build_type": args.build_type, "embree": version}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=("check", "renew"))
    for key in ("narpa", "scene", "build-type", "compiler"):
        parser.add_argument("--" + key, required=True)
    parser.add_argument("--sanitize", default="")
    args = parser.parse_args()

    if shutil.which("valgrind") is None:
        skip("there is no valgrind")
    if args.sanitize:
        skip("sanitizers change what is counted")
    cpu = pathlib.Path("/proc/cpuinfo")
    if not cpu.exists() or " avx2 " not in cpu.read_text() + " ":
        skip("the processor has no AVX2")
    if args.what == "check":
        if not NUMBERS.exists():
            sys.exit(f"{NUMBERS}: is not there, expected the numbers to hold; write it with: count.py renew")
        known = json.loads(NUMBERS.read_text())
        if known["tools"] != tools(args):
            skip(f"the numbers were taken with {known['tools']}, here is {tools(args)}")
    counted = count(args)
    if args.what == "renew":
        NUMBERS.write_text(json.dumps({"tools": tools(args), "instructions_per_ray": counted}, indent=2) + "\n")
        print(NUMBERS, counted)
        return
    bad = False
    for name, expected in known["instructions_per_ray"].items():
        change = counted[name] / expected - 1
        print(f"{name}: {counted[name]} instructions per primary ray, {expected} expected, {100 * change:+.2f} %")
        bad = bad or abs(change) > MARGIN
    if bad:
        command = " ".join(f'"{a}"' if " " in a or not a else a for a in sys.argv[2:])
        sys.exit(f"beyond {100 * MARGIN:g} %: where the change is meant, renew the numbers with\n"
                 f"  {sys.executable} {__file__} renew {command}")


if __name__ == "__main__":
    main()
