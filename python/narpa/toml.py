"""Writes a dictionary as TOML: scenes from Python have the same keys as scene files (docs/scene.md)."""
import datetime
import json
import math
import re
from collections.abc import Mapping

BARE_KEY = re.compile(r"[A-Za-z0-9_-]+")


def key_text(key):
    return key if BARE_KEY.fullmatch(key) else json.dumps(key)


def value_text(value):
    """A value on one line: str, bool, int, float, datetime, sequences (NumPy's too), mappings as inline tables."""
    if hasattr(value, "tolist"):  # NumPy
        value = value.tolist()
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False)  # TOML's basic strings have JSON's escapes
    if isinstance(value, int):
        return str(value)
    if isinstance(value, float):
        return repr(value) if math.isfinite(value) else str(value)
    if isinstance(value, (datetime.datetime, datetime.date)):
        return value.isoformat()
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{key_text(k)} = {value_text(v)}" for k, v in value.items()) + "}"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(map(value_text, value)) + "]"
    raise TypeError(f"{type(value).__name__} {value!r}: TOML has no such value, expected str, bool, int, float, datetime, list or dict")


def is_tables(value):
    return isinstance(value, (list, tuple)) and len(value) > 0 and all(isinstance(v, Mapping) for v in value)


def dumps(document):
    """The text of a dictionary of tables and lists of tables: {"sun": {...}, "body": [{...}, {...}]}.

    Lines and columns of a narpa.SceneError of a dictionary count in this text.
    """
    lines = []
    for name, value in document.items():
        if not isinstance(value, Mapping) and not is_tables(value):
            raise TypeError(f"{name}: expected a dict, or a list of dicts, as [{name}] and [[{name}]] of a scene file")
        for table in value if is_tables(value) else [value]:
            lines.append(f"[[{key_text(name)}]]" if is_tables(value) else f"[{key_text(name)}]")
            lines += [f"{key_text(key)} = {value_text(v)}" for key, v in table.items()]
            lines.append("")
    return "\n".join(lines)


def overrides_of(values):
    """{"sun.irradiance_w_m2": 1000} as KEY=VALUE of `--set`: a str is the VALUE itself, everything else is written as TOML."""
    if not isinstance(values or {}, Mapping):
        raise TypeError(f'overrides: expected a dict such as {{"camera.nav.detector.exposure_s": 0.002}}, not {type(values).__name__}')
    return [f"{key}={value if isinstance(value, str) else value_text(value)}" for key, value in (values or {}).items()]
