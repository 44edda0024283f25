"""Checks the documents of an installed tree: their links lead to installed files, and the commands that they print name no file of a
build folder; those that only look run.

Usage: documents.py PREFIX
"""
import re
import subprocess
import sys
import tempfile
from pathlib import Path

prefix = Path(sys.argv[1]).resolve()
share = prefix / "share/narpa"
documents = sorted(share.rglob("*.md"))
wrong = []


def anchors(document):
    """As GitHub makes them of headings."""
    found = set()
    for heading in re.findall(r"^#+ (.*)$", document.read_text(), re.M):
        words = re.sub(r"[^\w\- ]", "", re.sub(r"\[([^]]*)\]\([^)]*\)", r"\1", heading.strip()).lower())
        found.add(words.replace(" ", "-"))
    return found


links = 0
for document in documents:
    for target, _, anchor in re.findall(r"\]\(([^)#\s]*)(#([^)\s]*))?\)", document.read_text()):
        if re.match(r"\w+:", target):
            continue
        links += 1
        path = (document.parent / target).resolve() if target else document
        name = f"{document.relative_to(share)}: link to {target}{'#' + anchor if anchor else ''}"
        if not path.exists():
            wrong.append(f"{name} leads nowhere")
        elif share not in path.parents and path != share:
            wrong.append(f"{name} leads out of the installed tree")
        elif anchor and path.suffix == ".md" and anchor not in anchors(path):
            wrong.append(f"{name} names no heading")


def commands(document):
    """Lines of code that begin with a program of narpa, without comments and continuations."""
    fenced = False
    for line in document.read_text().splitlines():
        if line.startswith("```"):
            fenced = not fenced
        elif (fenced or line.startswith("    ")) and re.match(r"\s*narpa(-\w+)? ", line):
            yield line.strip()


# Programs that print and end, without devices and hours: their first command, without what is behind ; & | or #.
LOOKS = re.compile(r"narpa (list|check|--version)\b")
looked = 0
environment = {"PATH": f"{prefix}/bin:/usr/bin:/bin"}
for document in documents:
    for command in commands(document):
        where = f"{document.relative_to(share)}: {command}"
        if "build/" in command:
            wrong.append(f"{where}: names a file of a build folder")
        first = re.split(r"\s*(?:[;&|#]|\d?>)", command)[0]
        words = first.split()
        for word in words:  # inputs of scenes have to be shipped
            if re.search(r"^(?!out/|my)\w[\w-]*/[\w/-]+\.(toml|csv)$", word) and not any(
                (folder / word).exists() for folder in (share, share / "scenes")
            ):
                wrong.append(f"{where}: {word} is not installed")
        if not LOOKS.match(first) or re.search(r"\b(my|FILE|SCENE|SCENARIO|DIR|vcan0|/dev/)", first):
            continue
        looked += 1
        with tempfile.TemporaryDirectory() as folder:  # for what they write
            command = [prefix / "bin" / words[0], *words[1:]]
            ran = subprocess.run(command, env=environment, cwd=folder, capture_output=True, text=True)
        if ran.returncode not in (0, 3):  # 3: a device is missing
            wrong.append(f"{where}: exit {ran.returncode}: {ran.stderr.strip()[-300:]}")

if looked < 2:
    wrong.append(f"{looked} commands were tried, expected some")
print("\n".join(wrong) or f"{len(documents)} documents, {links} links, {looked} commands tried")
sys.exit(bool(wrong))
