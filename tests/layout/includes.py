"""Checks that every #include in a library refers to the library itself or to a library that it links, and that x.cpp
includes x.h first, so that x.h compiles alone.

Usage: includes.py LINKS SOURCE_DIR    LINKS: lines of "folder: linked linked ..."
"""
import pathlib
import re
import sys

lists, root = pathlib.Path(sys.argv[1]).read_text(), pathlib.Path(sys.argv[2])
links = {}
for line in lists.splitlines():
    library, _, linked = line.partition(":")
    links[library.strip()] = linked.split()


def reachable(library):
    """The library and all libraries that it links, directly or indirectly; "renderer" means every library below it."""
    seen, todo = set(), [library]
    while todo:
        here = todo.pop()
        if here in seen:
            continue
        seen.add(here)
        todo += links.get(here) or [r for r in links if r.startswith(here + "/")]
    return seen


def library_of(path):
    parts = path.split("/")
    for depth in (2, 1):
        candidate = "/".join(parts[:depth])
        if candidate in links or candidate == "base":
            return candidate
    return None


wrong = []
for library in links:
    allowed = reachable(library)
    for file in sorted((root / library).rglob("*")):
        if file.suffix not in (".h", ".cpp"):
            continue
        lines = file.read_text().splitlines()
        header = file.with_suffix(".h")
        first = next((line for line in lines if line.startswith("#include")), "")
        if file.suffix == ".cpp" and header.exists() and first != f'#include "{header.relative_to(root)}"':
            wrong.append(f"{file.relative_to(root)}: does not include {header.name} first")
        for number, line in enumerate(lines, 1):
            include = re.match(r'#include "([^"]+)"', line)
            if include and (target := library_of(include[1])) and target not in allowed:
                wrong.append(f"{file.relative_to(root)}:{number}: {library} does not link {target}: {include[1]}")
print("\n".join(wrong) or f"{len(links)} libraries: every include points down")
sys.exit(bool(wrong))
