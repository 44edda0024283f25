"""The JSON schemas that `narpa check --schema` prints: shipped files are valid, the key tables of the documents state the same
keys, ranges and choices, and broken files are refused by the schema and by `narpa check` alike.

Usage: schema.py NARPA SOURCE_DIR"""
import datetime
import json
import math
import pathlib
import re
import subprocess
import sys
import tempfile
import unittest

try:
    import jsonschema
    import tomllib
except ImportError as missing:
    print(f"SKIP: {missing} (scripts/setup test)")
    sys.exit(77)

from broken_files import BROKEN, BROKEN_RECIPES, BROKEN_SCENARIOS, BROKEN_SKY, GOOD, GOOD_RECIPE, GOOD_SCENARIO, ITS_SCENE, SKY

NARPA, SOURCE = sys.argv[1], pathlib.Path(sys.argv[2])
GOOD = GOOD.replace("CATALOGUE", str(SOURCE.resolve() / "scenes/stars/brightest.csv"))


def schema(kind):
    said = subprocess.run([NARPA, "check", "--schema", kind], capture_output=True, text=True, check=True)
    return json.loads(said.stdout)


SCHEMAS = {kind: schema(kind) for kind in ("scene", "lidar", "trajectory", "scenario", "dataset")}


def errors(kind, document):
    return [e.message for e in jsonschema.Draft202012Validator(SCHEMAS[kind]).iter_errors(document)]


def plain(value):
    """Dates as texts, as editors see them."""
    if isinstance(value, dict):
        return {key: plain(v) for key, v in value.items()}
    if isinstance(value, list):
        return [plain(v) for v in value]
    return value.isoformat() if isinstance(value, (datetime.date, datetime.datetime)) else value


def merged(path, head):
    """The file, with what it takes from the file that it is based on."""
    own = plain(tomllib.loads(path.read_text()))
    whole_lists = {"leg", *own.get(head, {}).get("replaces", [])}

    def is_named(value):
        return isinstance(value, list) and value and all(isinstance(one, dict) and "name" in one for one in value)

    def fill(over, under, whole_lists=()):
        for key, value in under.items():
            mine = over.get(key)
            if isinstance(value, dict) and isinstance(mine, dict):
                fill(mine, value)
            elif key not in whole_lists and is_named(value) and is_named(mine):
                by_name = {one["name"]: one for one in mine}
                for one in value:
                    fill(by_name.setdefault(one["name"], {}), one)
                over[key] = list(by_name.values())
            else:
                over.setdefault(key, value)

    if base := own.get(head, {}).get("based_on"):
        under = merged(path.parent / base, head)
        under.get(head, {}).pop("replaces", None)
        fill(own, under, whole_lists)
    return own


def kind_of(document):
    if isinstance(document.get("lidar"), dict):
        return "lidar"
    return next((kind for kind in ("trajectory", "scenario", "dataset") if kind in document), "scene")


# --- The documents ---

NUMBER = r"[+-]?\d+(?:\.\d+)?(?:e[+-]?\d+)?"
# Cells with more than one interval, for kinds or makes, or with one that depends on other keys.
FREE = {"scene/lidar/model", "scene/lidar/rate_hz", "scene/lidar/range_min_m", "scene/lidar/range_max_m",
        "scene/lidar/returns", "scene/lidar/sub_rays", "scene/lidar/columns", "scene/render/seed",
        "lidar/lidar/rate_hz_min", "lidar/lidar/rate_hz_max", "lidar/lidar/range_resolution_m",
        "lidar/lidar/velocity_resolution_m_s", "lidar/lidar/name", "lidar/grid/fov_horizontal_deg",
        "lidar/grid/fov_vertical_deg", "scene/body/can_id", "scene/body.mark/id", "scene/camera/format",
        "scene/camera.detector/black_level_dn"}
# Keys of sections that share a table, described by a table of their own.
SHARED = {"name", "mount", "position_m", "attitude_wxyz", "look_at", "up"}


def interval(text):
    """(low, low is open, high, high is open) of "0 to < 180", "> 0", "+-5", "(0, 1]"; None: it is none."""
    text = text.strip().removesuffix(", or inf")
    if m := re.fullmatch(rf"(>=?)\s*({NUMBER})(?: to (<?)\s*({NUMBER}))?", text):
        return float(m[2]), m[1] == ">", float(m[4]) if m[4] else math.inf, m[3] == "<"
    if m := re.fullmatch(rf"({NUMBER}) to (<?)\s*({NUMBER})", text):
        return float(m[1]), False, float(m[3]), m[2] == "<"
    if m := re.fullmatch(rf"\+-({NUMBER})", text):
        return -float(m[1]), False, float(m[1]), False
    if m := re.fullmatch(rf"([(\[])({NUMBER}), ({NUMBER})([)\]])", text):
        return float(m[2]), m[1] == "(", float(m[3]), m[4] == ")"
    return None


def interval_of(value):
    """The same of a schema, of its items where it is an array."""
    for part in [value, value.get("items", {}), *value.get("anyOf", [])]:
        if part.get("type") in ("number", "integer") and part.keys() & {"minimum", "exclusiveMinimum", "maximum", "exclusiveMaximum"}:
            return (part.get("minimum", part.get("exclusiveMinimum", -math.inf)), "exclusiveMinimum" in part,
                    part.get("maximum", part.get("exclusiveMaximum", math.inf)), "exclusiveMaximum" in part)
    return None


def choices_of(value):
    return value.get("enum") or next((part["enum"] for part in value.get("anyOf", []) if "enum" in part), None)


def agree(documented, own):
    """`> 0` in a document stands for limits that no use reaches, too."""
    if own is None or documented is None:
        return own is documented
    no_limit = documented[2] == math.inf and own[2] >= 1e9
    return documented[:2] == own[:2] and (no_limit or documented[2:] == own[2:])


def documented_rows(file, home=""):
    """(table, kinds, keys, cells by heading) of each row of a key table; `home`: the table of sections that name none."""
    section, table, heads, kinds, rows = home, home, [], [], []
    for line in file.read_text().splitlines():
        if line.startswith("## "):
            m = re.match(r"## \[+([\w.]+)\]", line)
            section = table = m[1] if m else home
        elif m := re.match(r"(?:### |`)(\w+) = \{", line):
            table = f"{section}.{m[1]}"
        cells = [c.strip() for c in line.strip("|").split("|")]
        if not line.startswith("|"):
            heads, kinds = [], []
            continue
        if not heads:
            heads = cells
            continue
        column = {"key": 0, "key of `dem`": 0, "keys of all kinds": 0, "`kind`": 1}.get(heads[0])
        if not section or column is None or heads[column].startswith("`"):
            continue
        if column == 1:
            kinds = re.findall(r'"(\w+)"', cells[0]) or kinds
        if keys := re.findall(r"`(\w+)`", cells[column]):
            rows.append((table, kinds, keys, dict(zip(heads, cells))))
    return rows


def rehearsal_rows(file):
    """(table, keys, default, meaning) of each row of the key tables that name the table in their first column."""
    tables, rows, inside = [], [], False
    for line in file.read_text().splitlines():
        cells = [c.strip() for c in line.strip("|").split("|")]
        inside = line.startswith("| table | key |") or (inside and line.startswith("|"))
        if inside and "`" in cells[1]:
            tables = re.findall(r"`\[+(\w+)\]+`", cells[0]) or tables
            names = cells[1] if "..." not in cells[1] else cells[3]
            rows += [(table, re.findall(r"`(\w+)(?: = [^`]*)?`", names), cells[2], cells[3]) for table in tables]
    return rows


def table_at(kind, path):
    """The schema of a table, "camera.detector"; None: it has no rows."""
    table = SCHEMAS[kind]
    for name in path.split("."):
        value = table["properties"].get(name, {})
        table = next((t for t in [value, value.get("items", {}), *value.get("anyOf", [])] if "properties" in t), None)
        if table is None:
            return None
    return table


def values_of(table, key, kinds):
    """The schemas of a key, in tables of these kinds; no kinds: of all that have it."""
    if (value := table["properties"].get(key, False)) is not True:
        return [value] if value else []
    own = {next(iter(rule["if"]["properties"].values()))["const"]: rule["then"]["properties"][key] for rule in table["allOf"]}
    if kinds:
        return [own[kind] for kind in kinds] if all(own[kind] for kind in kinds) else []
    return [value for value in own.values() if value]


class Output(unittest.TestCase):
    def test_json_is_one_document(self):
        said = subprocess.run([NARPA, "check", "--schema", "scene", "--json"], capture_output=True, text=True, check=True)
        self.assertEqual(json.loads(said.stdout), SCHEMAS["scene"])


class Documents(unittest.TestCase):
    def compare_row(self, values, keys, i, cells):
        ranges = re.split(r",(?![^(\[]*[)\]])", cells["range"])
        text = (ranges[i] if len(ranges) == len(keys) else cells["range"]).split(";")[0]
        for value in values:
            if choices := choices_of(value):
                self.assertEqual(sorted(choices), sorted(re.findall(r'"([^"]+)"', cells["range"])))
            elif value.get("type") != "boolean":
                own = interval_of(value)
                self.assertTrue(agree(interval(text), own), f"the document says {text!r}, the row {own}")

    def compare(self, kind, file, home=""):
        documented = {}
        for path, kinds, keys, cells in documented_rows(SOURCE / "docs" / file, home):
            table = table_at(kind, path)
            self.assertIsNotNone(table, f"[{path}] of {file} has no rows")
            documented.setdefault(path, set()).update(keys, ["kind"] if kinds else [])
            for i, key in enumerate(keys):
                with self.subTest(file=file, table=path, kinds=kinds, key=key):
                    values = values_of(table, key, kinds)
                    self.assertTrue(values, "the document has a key without a row")
                    if f"{kind}/{path}/{key}" not in FREE and key not in SHARED and not cells.get("range", "as").startswith("as"):
                        self.compare_row(values, keys, i, cells)
        for path, keys in documented.items():
            rows = set(table_at(kind, path)["properties"]) - keys
            self.assertFalse(rows - SHARED, f"[{path}]: rows that {file} lacks")
        return documented

    def test_scene(self):
        documented = self.compare("scene", "scene.md")
        self.assertLessEqual({"camera.detector", "camera.psf", "body.material", "light", "stars", "sky"}, set(documented))

    def test_terrain(self):
        self.assertEqual(set(self.compare("scene", "terrain.md", "body.dem")), {"body.dem", "body.dem.detail"})

    def test_lidar(self):
        self.compare("lidar", "lidar-description.md")

    def test_trajectory(self):
        documented = self.compare("trajectory", "trajectories.md")
        self.assertLessEqual({"trajectory", "world", "body", "body.table", "body.table.time", "body.table.attitude"}, set(documented))


    def test_dataset(self):
        documented = self.compare("dataset", "datasets.md")
        self.assertEqual({path.split(".")[0] for path in documented}, set(SCHEMAS["dataset"]["properties"]))
        self.assertLessEqual({"pose.range_m", "pose.attitude"}, set(documented))


class RehearsalDocument(unittest.TestCase):
    """docs/rehearsal.md describes scenarios by tables without ranges: keys, required ones, kinds, choices, defaults."""

    def test_scenario(self):
        documented = {}
        for name, keys, default, meaning in rehearsal_rows(SOURCE / "docs" / "rehearsal.md"):
            table = SCHEMAS["scenario"]["properties"].get(name)
            self.assertIsNotNone(table, f"[{name}] has no rows")
            table = table.get("items", table)
            documented.setdefault(name, set()).update(keys)
            defaults = re.split(r", (?![^\[]*\])", default)
            for i, key in enumerate(keys):
                with self.subTest(table=name, key=key):
                    value = table["properties"].get(key)
                    self.assertIsNotNone(value, "the document has a key without a row")
                    own = defaults[i] if len(defaults) == len(keys) else default
                    required = key in table.get("required", [])
                    if default not in ("required by these kinds", ""):
                        self.assertEqual(own == "required", required)
                    if re.fullmatch(NUMBER, own) and value is not True and value.get("type") in ("number", "integer"):
                        self.assertEqual(list(jsonschema.Draft202012Validator(value).iter_errors(float(own))), [])
                    if value is not True and value.get("type") == "object":
                        inner, words = set(value["properties"]), set(re.findall(r"\w+", meaning))
                        self.assertLessEqual(inner, words)
                        self.assertLessEqual({word for word in words if "_" in word}, inner)
        for name, keys in documented.items():
            table = SCHEMAS["scenario"]["properties"][name]
            rows = set(table.get("items", table)["properties"])
            self.assertFalse(rows - keys, f"[{name}]: rows that rehearsal.md lacks")
        self.assertEqual(set(SCHEMAS["scenario"]["properties"]), set(documented))

    def test_words(self):
        text = (SOURCE / "docs" / "rehearsal.md").read_text()
        tables = SCHEMAS["scenario"]["properties"]
        kinds = tables["fault"]["items"]["properties"]["kind"]["enum"]
        self.assertEqual(sorted(kinds), sorted(re.findall(r'`kind = "(\w+)"`', text)))
        for word in tables["orbit"]["properties"]["model"]["enum"]:
            self.assertIn(f'"{word}"', text)
        for word in tables["navigation"]["properties"]["camera_method"]["enum"]:
            self.assertIn(f"`{word}`", text)


class Shipped(unittest.TestCase):
    def test_every_file_is_valid(self):
        counts = {}
        for path in sorted((SOURCE / "scenes").rglob("*.toml")):
            kind = kind_of(tomllib.loads(path.read_text()))
            if kind not in SCHEMAS:
                continue
            counts[kind] = counts.get(kind, 0) + 1
            with self.subTest(file=str(path)):
                self.assertEqual(errors(kind, merged(path, kind)), [])
        for kind in SCHEMAS:
            self.assertGreater(counts.get(kind, 0), 0, kind)


# --- Broken files ---

class Broken(unittest.TestCase):
    def accepted_by_narpa(self, text):
        with tempfile.TemporaryDirectory() as folder:
            path = pathlib.Path(folder) / "file.toml"
            path.write_text(text)
            (pathlib.Path(folder) / "scene.toml").write_text(ITS_SCENE)
            said = subprocess.run([NARPA, "check", str(path)], capture_output=True, text=True)
            self.assertIn(said.returncode, (0, 2), said.stderr)
            return said.returncode == 0, said.stderr

    def refused(self, kind, good, line, wrong):
        """What narpa says of a file in which this line is wrong."""
        with self.subTest(line=line, wrong=wrong):
            self.assertEqual(good.count(f"\n{line}\n"), 1)
            text = good.replace(f"\n{line}\n", f"\n{wrong}\n")
            self.assertNotEqual(errors(kind, tomllib.loads(text)), [])
            accepted, said = self.accepted_by_narpa(text)
            self.assertFalse(accepted)
            return said
        return ""

    def compare(self, kind, good, broken, least):
        self.assertEqual(errors(kind, tomllib.loads(good)), [])
        accepted, why = self.accepted_by_narpa(good)
        self.assertTrue(accepted, why)
        self.assertGreaterEqual(len(broken), least)
        for line, wrong in broken:
            self.refused(kind, good, line, wrong)

    def test_each_broken_scene_is_refused_by_both(self):
        self.compare("scene", GOOD, BROKEN, 150)

    def test_each_broken_scenario_is_refused_by_both(self):
        self.compare("scenario", GOOD_SCENARIO, BROKEN_SCENARIOS, 50)

    def test_each_broken_recipe_is_refused_by_both(self):
        self.compare("dataset", GOOD_RECIPE, BROKEN_RECIPES, 25)

    def test_each_broken_sky_and_terrain_is_refused_by_both(self):
        self.assertEqual(errors("scene", tomllib.loads(SKY)), [])
        self.assertIn("none.tif: no such file", self.accepted_by_narpa(SKY)[1])
        for line, wrong in BROKEN_SKY:
            self.assertNotIn("none.tif", self.refused("scene", SKY, line, wrong))


unittest.main(argv=sys.argv[:1])
