"""Checks the one-definition rule for types: no two sources define a type of the same name outside an unnamed namespace. No
compiler detects this in different translation units; a program would use one of the definitions for both.

Usage: definitions.py SOURCE_DIR FOLDER...
"""
import collections
import pathlib
import re
import sys

TYPE = re.compile(r"(?:template <.*> )?(?:struct|class|union|enum(?: class)?) (?:alignas\(.*?\) |\[\[\w+\]\] )?([\w:]+)(?: final)?(?: :.*)? \{")
NAMESPACE = re.compile(r"(?:inline )?namespace ([\w:]*) ?\{")


def types_of(file):
    """(qualified name, line) of each type that the file defines at namespace scope with external linkage."""
    namespaces = []
    for number, line in enumerate(file.read_text().splitlines(), 1):
        if opened := NAMESPACE.match(line):
            namespaces.append(opened[1])
        elif line.startswith("}  // namespace"):
            namespaces.pop()
        elif (found := TYPE.match(line)) and "" not in namespaces:
            yield "::".join([*namespaces, found[1]]), number


root, places = pathlib.Path(sys.argv[1]), collections.defaultdict(list)
for folder in sys.argv[2:]:
    for file in sorted((root / folder).rglob("*")):
        if file.suffix in (".h", ".cpp"):
            for name, line in types_of(file):
                places[name].append(f"{file.relative_to(root)}:{line}")
wrong = [f"{name} is defined at {', '.join(where)}" for name, where in places.items() if len(where) > 1]
print("\n".join(wrong) or f"{len(places)} types: each is defined once")
sys.exit(bool(wrong))
