#!/usr/bin/python3
"""Manual pages from the text of --help.

Usage: make_man.py FOLDER VERSION PROGRAM...    writes FOLDER/NAME.1 of each program, and of each of narpa's commands
"""
import re
import subprocess
import sys
from pathlib import Path


def help_of(*command):
    done = subprocess.run([*map(str, command), "--help"], capture_output=True, text=True, check=True)
    return done.stdout


def escaped(line):
    line = line.replace("\\", "\\e").replace("-", "\\-")
    return "\\&" + line if line[:1] in (".", "'") else line


def page(name, text, version):
    """Headings are the lines of the text that begin at the margin and end with a colon; what follows stays as it is."""
    lines = text.rstrip().splitlines()
    first = lines[0].removeprefix(f"{name} ").rstrip(".")
    out = [f'.TH {name.upper()} 1 "" "narpa {version}" "narpa"', ".SH NAME", f"{escaped(name)} \\- {escaped(first)}"]
    open_block = False
    for line in lines[1:]:
        one_line = re.fullmatch(r"(Usage|Exit status): (.*)", line)
        if one_line or re.fullmatch(r"\S[^:]*:", line):
            if open_block:
                out.append(".fi")
            heading, rest = one_line.groups() if one_line else (line.rstrip(":"), "")
            out += [f'.SH "{ {"Usage": "SYNOPSIS"}.get(heading, heading.upper()) }"', ".nf"]
            open_block = True
            if rest:
                out.append(escaped(rest))
        elif open_block or line.strip():
            if not open_block:
                out += [".SH DESCRIPTION", ".nf"]
                open_block = True
            out.append(escaped(line.removeprefix("  ")))
    if open_block:
        out.append(".fi")
    return "\n".join(line for line in out if line is not None) + "\n"


def commands_of(text):
    """Names of the subcommands: indented by two, with an explanation, before the section Options."""
    return re.findall(r"^  ([a-z]+)  +\S", text.split("\nOptions:")[0], re.M)


folder, version = Path(sys.argv[1]), sys.argv[2]
folder.mkdir(parents=True, exist_ok=True)
for program in map(Path, sys.argv[3:]):
    text = help_of(program)
    (folder / f"{program.name}.1").write_text(page(program.name, text, version))
    if program.name == "narpa":
        for command in commands_of(text):
            name = f"narpa-{command}"
            (folder / f"{name}.1").write_text(page(name, help_of(program, command), version))
