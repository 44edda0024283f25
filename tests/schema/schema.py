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

NARPA, SOURCE = sys.argv[1], pathlib.Path(sys.argv[2])


def schema(kind):
    said = subprocess.run([NARPA, "check", "--schema", kind], capture_output=True, text=True, check=True)
    return json.loads(said.stdout)


SCHEMAS = {kind: schema(kind) for kind in ("scene", "lidar", "scenario")}


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

    def fill(over, under):
        for key, value in under.items():
            if isinstance(value, dict) and isinstance(over.get(key), dict):
                fill(over[key], value)
            else:
                over.setdefault(key, value)

    if base := own.get(head, {}).get("based_on"):
        fill(own, merged(path.parent / base, head))
    return own


def kind_of(document):
    if isinstance(document.get("lidar"), dict):
        return "lidar"
    return "scenario" if "scenario" in document else "scene"


# --- The documents ---

NUMBER = r"[+-]?\d+(?:\.\d+)?(?:e[+-]?\d+)?"
# Cells with more than one interval, for kinds or makes, or with one that depends on other keys.
FREE = {"scene/lidar/model", "scene/lidar/rate_hz", "scene/lidar/range_min_m", "scene/lidar/range_max_m",
        "scene/lidar/returns", "scene/lidar/sub_rays", "scene/lidar/columns", "scene/render/seed",
        "lidar/lidar/rate_hz_min", "lidar/lidar/rate_hz_max", "lidar/lidar/range_resolution_m",
        "lidar/lidar/velocity_resolution_m_s", "lidar/lidar/name", "lidar/grid/fov_horizontal_deg",
        "lidar/grid/fov_vertical_deg", "scene/body/can_id", "scene/camera/format",
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

GOOD = """
[scene]
name = "s"
epoch = "2026-03-01T12:00:00Z"
[sun]
direction = [1.0, 0.0, 0.0]
irradiance_w_m2 = 1361
angular_diameter_deg = 0.5
[render]
method = "path"
max_depth = 3
spp = 2
seed = 1
stale_after_s = 0.5
command_ahead_max_s = 60
[observer]
latitude_deg = 50
longitude_deg = 8
height_m = 100
ut1_utc_s = 0.1
temperature_c = 10
pressure_hpa = 1010
refraction = true
sees = ["ball"]
sun = true
[[body]]
name = "ball"
position_m = [0.0, 30.0, 0.0]
sphere = {radius_m = 1.0}
can_id = 16
[body.material]
kind = "phong"
specular = 0.2
exponent = 9
emission = [0.1, 0.2, 0.3]
retroreflectance = 2
[[body]]
name = "egg"
velocity_m_s = [1.0, 0.0, 0.0]
rate_rad_s = [0.1, 0.0, 0.0]
[body.ellipsoid]
semi_axes_m = [1.0, 2.0, 3.0]
[body.material]
kind = "ggx"
metallic = 1
roughness = 0.2
ior = 2.5
fresnel = "exact"
[[body]]
name = "comet"
material = {kind = "hapke", albedo = 0.05, b = 0.3, c = 0.2, opposition_b0 = 1, opposition_h = 0.06, roughness_deg = 20}
rotation = "eros"
[body.sphere]
radius_m = 500
[[body]]
name = "satellite"
sphere = {radius_m = 3.0}
[body.orbit]
semi_major_axis_m = 7e6
eccentricity = 0.01
mean_anomaly_deg = 20
[[body]]
name = "planet"
sphere = {radius_m = 6371000}
position_m = [0.0, 0.0, -1e7]
[atmosphere]
body = "planet"
planet = "earth"
turbidity = 2
ozone_du = 250
steps = 8
samples_per_band = 1
[stars]
catalogue = "CATALOGUE"
epoch = 2026.2
faintest = 2
rate_rad_s = [0.0, 0.0, 0.001]
[[light]]
name = "lamp"
kind = "point"
intensity_w_sr = 5
position_m = [1.0, 2.0, 3.0]
[[light]]
name = "panel"
kind = "rectangle"
radiance_w_m2_sr = [1.0, 2.0, 3.0]
size_m = [1.0, 0.5]
look_at = [0.0, 30.0, 0.0]
[[light]]
name = "spot"
kind = "disc"
radiance_w_m2_sr = 7
radius_m = 0.1
[[camera]]
name = "c"
look_at = [0.0, 30.0, 1.0]
resolution = [128, 96]
fov_horizontal_deg = 20
format = "Y16"
rate_hz = 5
embedded_line = true
late_policy = "drop"
veiling_glare = 0.01
distortion = {model = "fisheye", coefficients = [0.0, 0.0, 0.0, 0.0]}
[camera.detector]
exposure_s = 0.001
bits = 10
quantum_efficiency = 0.6
shot_noise = true
black_level_dn = 16
prnu = 0.01
temperature_c = -10
[camera.shutter]
kind = "rolling"
row_time_s = 1e-5
[camera.control]
latency_s = 0.005
trigger = "command"
gain_max_db = 18
[camera.lens]
aperture_diameter_m = 0.01
focus_distance_m = 20
[camera.psf]
sigma_px = 0.8
[camera.vignetting]
polynomial = [-0.05, 0.01]
[camera.ghost]
strength = 1e-4
radius_px = 9
within_deg = 25
[[camera]]
name = "wide"
resolution = [48, 64]
projection = {kind = "double_sphere", xi = -0.2, alpha = 0.6}
intrinsics = {fx = 30, fy = 30}
white_radiance = 100
[[lidar]]
name = "l"
model = "VLP-16"
position_m = [0.0, 0.0, 0.0]
attitude_wxyz = [1.0, 0.0, 0.0, 0.0]
rate_hz = 10
pps = "locked"
returns = "last"
range_max_m = 100
beam_divergence_rad = 0.003
sub_rays = 8
multipath = "none"
range_at_10_percent_m = 50
range_noise_m = 0.01
""".replace("CATALOGUE", str(SOURCE.resolve() / "scenes/stars/brightest.csv"))

SKY = """
[sun]
direction = [0.0, 0.0, 1.0]
[sky]
model = "hosek-wilkie"
turbidity = 2
ground_albedo = 0.2
up = [0.0, 0.0, 1.0]
[[body]]
name = "ground"
[body.dem]
file = "none.tif"
on = "tangent"
has = "heights"
error_px = 1
seen_from_m = [[0.0, 0.0, 100.0]]
budget_mib = 100
detail = {posts = 4, craters_per_m2 = 0.08}
[[camera]]
name = "c"
resolution = [64, 48]
fov_diagonal_deg = 20
"""

# (line of GOOD, what replaces it)
BROKEN = [
    ('name = "s"', "name = 7"), ('name = "s"', 'names = "s"'), ('epoch = "2026-03-01T12:00:00Z"', "epoch = 2026"),
    ('epoch = "2026-03-01T12:00:00Z"', 'epok = "2026-03-01T12:00:00Z"'),
    ("direction = [1.0, 0.0, 0.0]", "direction = [1.0, 0.0]"), ("direction = [1.0, 0.0, 0.0]", 'direction = "x"'),
    ("direction = [1.0, 0.0, 0.0]", "direction = [1.0, 0.0, true]"),
    ("irradiance_w_m2 = 1361", "irradiance_w_m2 = 0"), ("irradiance_w_m2 = 1361", "irradiance = 1361"),
    ("irradiance_w_m2 = 1361", 'irradiance_w_m2 = "bright"'), ("angular_diameter_deg = 0.5", "angular_diameter_deg = 180"),
    ("angular_diameter_deg = 0.5", "angular_diameter_deg = -0.1"), ('method = "path"', 'method = "guess"'),
    ('method = "path"', "method = 1"), ("max_depth = 3", "max_depth = 41"), ("max_depth = 3", "max_depth = 2.5"),
    ("max_depth = 3", "depth = 3"), ("spp = 2", "spp = 0"), ("spp = 2", "spp = 65536"), ("spp = 2", "spp = true"),
    ("seed = 1", "seed = -1"), ("stale_after_s = 0.5", "stale_after_s = 0"),
    ("command_ahead_max_s = 60", "command_ahead_max_s = 140001"), ("latitude_deg = 50", "latitude_deg = 91"),
    ("latitude_deg = 50", ""), ("longitude_deg = 8", ""), ("longitude_deg = 8", "longitude_deg = -361"),
    ("height_m = 100", "height_m = 20001"), ("ut1_utc_s = 0.1", "ut1_utc_s = 1"),
    ("temperature_c = 10", "temperature_c = 283"), ("temperature_c = 10", "temperature_k = 283"),
    ("pressure_hpa = 1010", "pressure_hpa = 101325"), ("refraction = true", "refraction = 1"),
    ('sees = ["ball"]', 'sees = "ball"'), ('sees = ["ball"]', "sees = [1]"), ("sun = true", 'sun = "yes"'),
    ('name = "l"', ""), ('model = "VLP-16"', ""), ('model = "VLP-16"', 'model = "VLP-17"'),
    ('model = "VLP-16"', "model = 16"), ("position_m = [0.0, 0.0, 0.0]", "position_m = [0.0, 0.0]"),
    ("attitude_wxyz = [1.0, 0.0, 0.0, 0.0]", "attitude_wxyz = [1.0, 0.0, 0.0]"),
    ("attitude_wxyz = [1.0, 0.0, 0.0, 0.0]", "attitude_wxyz = [2.0, 0.0, 0.0, 0.0]"), ("rate_hz = 10", "rate_hz = 0"),
    ('pps = "locked"', 'pps = "maybe"'), ('returns = "last"', 'returns = "first"'),
    ("range_max_m = 100", "range_max_m = -1"), ("beam_divergence_rad = 0.003", "beam_divergence_rad = 0.2"),
    ("beam_divergence_rad = 0.003", "divergence_rad = 0.003"), ("sub_rays = 8", "sub_rays = 65"),
    ("sub_rays = 8", "sub_rays = 8.5"), ('multipath = "none"', 'multipath = "some"'),
    ("range_at_10_percent_m = 50", "range_at_10_percent_m = 0"), ("range_noise_m = 0.01", "range_noise_m = -0.01"),
    ("range_noise_m = 0.01", "range_noise_m = [0.01]"), ("[sun]", "[suns]"), ("[render]", "[renderer]"),
    # bodies and materials
    ("can_id = 16", "can_id = 1536"), ("can_id = 16", "can_id = 0.5"), ("sphere = {radius_m = 1.0}", "sphere = {radius_m = 0}"),
    ("sphere = {radius_m = 1.0}", "sphere = {}"), ("sphere = {radius_m = 1.0}", "sphere = 1.0"),
    ("position_m = [0.0, 30.0, 0.0]", "position_m = 30.0"), ('name = "egg"', ""), ('name = "egg"', "name = 3"),
    ("velocity_m_s = [1.0, 0.0, 0.0]", "velocity_m_s = [1.0]"), ("rate_rad_s = [0.1, 0.0, 0.0]", "rate_deg_s = [0.1, 0.0, 0.0]"),
    ("semi_axes_m = [1.0, 2.0, 3.0]", "semi_axes_m = [1.0, 2.0]"), ("semi_axes_m = [1.0, 2.0, 3.0]", ""),
    ("semi_axes_m = [1.0, 2.0, 3.0]", "semi_axes_m = [1.0, 2.0, -3.0]"), ('rotation = "eros"', 'rotation = "vulcan"'),
    ("semi_major_axis_m = 7e6", "semi_major_axis_m = 6e6"), ("semi_major_axis_m = 7e6", ""), ("eccentricity = 0.01", "eccentricity = 1"),
    ('kind = "phong"', 'kind = "lambert"'), ('kind = "phong"', 'kind = "blinn"'), ("specular = 0.2", ""), ("specular = 0.2", "specular = 1.2"),
    ("specular = 0.2", "specular = [0.2, 0.2]"), ("exponent = 9", ""), ("exponent = 9", "shininess = 9"),
    ("emission = [0.1, 0.2, 0.3]", "emission = -1"), ("emission = [0.1, 0.2, 0.3]", 'emission = "red"'),
    ("retroreflectance = 2", "retroreflectance = 1e7"), ("metallic = 1", "metallic = 2"), ("metallic = 1", "asymmetry = 0.1"),
    ("ior = 2.5", "ior = 5"), ('kind = "ggx"', 'kind = "dielectric"'), ('fresnel = "exact"', 'fresnel = "none"'),
    ('fresnel = "exact"', "texture = {wrap = 'clamp'}"), ('fresnel = "exact"', "texture = 3"),
    ('fresnel = "exact"', "normal_texture = {file = 'a.png', colour = 'srgb'}"),
    # lights, air and stars
    ("intensity_w_sr = 5", ""), ("intensity_w_sr = 5", "intensity_w_sr = -5"), ("intensity_w_sr = 5", "radiance_w_m2_sr = 5"),
    ('kind = "point"', 'kind = "directional"'), ('kind = "point"', ""), ("position_m = [1.0, 2.0, 3.0]", "look_at = [1.0, 2.0, 3.0]"),
    ("radiance_w_m2_sr = [1.0, 2.0, 3.0]", "radiance_w_m2_sr = [1.0, 2.0]"), ("size_m = [1.0, 0.5]", ""), ("size_m = [1.0, 0.5]", "size_m = [1.0, 0]"),
    ("look_at = [0.0, 30.0, 0.0]", "look_at = 30.0"), ('kind = "disc"', 'kind = "rectangle"'), ("radius_m = 0.1", "radius_m = 1e13"),
    ('body = "planet"', ""), ('planet = "earth"', 'planet = "venus"'), ("turbidity = 2", "turbidity = 0.5"), ("ozone_du = 250", "ozone_du = -1"),
    ("steps = 8", "steps = 3"), ("samples_per_band = 1", "samples_per_band = 9"), ("epoch = 2026.2", "epoch = 20262"),
    ("faintest = 2", "faintest = true"), ("rate_rad_s = [0.0, 0.0, 0.001]", "rate_rad_s = [0.0, 0.0, 1001]"),
    # cameras
    ('name = "c"', ""), ("look_at = [0.0, 30.0, 1.0]", "lookat = [0.0, 30.0, 1.0]"), ("resolution = [128, 96]", "resolution = [64, 0]"),
    ("resolution = [128, 96]", "resolution = [64, 16385]"), ("fov_horizontal_deg = 20", "fov_horizontal_deg = 360"),
    ("fov_horizontal_deg = 20", "fov_deg = 20"), ('format = "Y16"', 'format = "Y12"'), ("rate_hz = 5", "rate_hz = 1e5"),
    ("embedded_line = true", "embedded_line = 1"), ('late_policy = "drop"', 'late_policy = "wait"'), ("veiling_glare = 0.01", "veiling_glare = 1"),
    ('distortion = {model = "fisheye", coefficients = [0.0, 0.0, 0.0, 0.0]}', 'distortion = {model = "fisheye", coefficients = [0.0, 0.0, 0.0, 0.0, 0.0]}'),
    ('distortion = {model = "fisheye", coefficients = [0.0, 0.0, 0.0, 0.0]}', 'distortion = {model = "fov", coefficients = [0.0, 0.0, 0.0, 0.0]}'),
    ('distortion = {model = "fisheye", coefficients = [0.0, 0.0, 0.0, 0.0]}', 'distortion = {coefficients = [0.0, 0.0, 0.0, 0.0]}'),
    ("exposure_s = 0.001", "exposure_s = 0"), ("exposure_s = 0.001", "exposure = 0.001"), ("bits = 10", "bits = 17"), ("bits = 10", "bits = 10.5"),
    ("quantum_efficiency = 0.6", "quantum_efficiency = 60"), ("shot_noise = true", "shot_noise = 1"), ("black_level_dn = 16", "black_level_dn = -1"),
    ("prnu = 0.01", "prnu = 1"), ("temperature_c = -10", "temperature_c = -300"), ("row_time_s = 1e-5", ""), ("row_time_s = 1e-5", "row_time_s = 0"),
    ('kind = "rolling"', 'kind = "global"'), ('kind = "rolling"', ""), ("latency_s = 0.005", "latency_s = 0"), ('trigger = "command"', 'trigger = "edge"'),
    ("gain_max_db = 18", "gain_max_db = 61"), ("focus_distance_m = 20", ""), ("focus_distance_m = 20", "focus_distance_m = -1"),
    ("aperture_diameter_m = 0.01", "aperture_diameter_m = 0"), ("sigma_px = 0.8", "sigma_px = 9"), ("polynomial = [-0.05, 0.01]", "polynomial = []"),
    ("polynomial = [-0.05, 0.01]", "polynomial = [1, 2, 3, 4]"), ("strength = 1e-4", "strength = 2"), ("radius_px = 9", ""), ("within_deg = 25", "within_deg = 90"),
    ('projection = {kind = "double_sphere", xi = -0.2, alpha = 0.6}', 'projection = {kind = "double_sphere", xi = -1, alpha = 0.6}'),
    ('projection = {kind = "double_sphere", xi = -0.2, alpha = 0.6}', 'projection = {kind = "double_sphere", xi = -0.2}'),
    ('projection = {kind = "double_sphere", xi = -0.2, alpha = 0.6}', 'projection = {kind = "pinhole", xi = -0.2, alpha = 0.6}'),
    ("intrinsics = {fx = 30, fy = 30}", "intrinsics = {fx = 30}"), ("intrinsics = {fx = 30, fy = 30}", "intrinsics = {fx = 30, fy = 0}"),
    ("white_radiance = 100", "white_radiance = 0"),
]

# The same of SKY; its DEM is missing.
BROKEN_SKY = [
    ('model = "hosek-wilkie"', ""), ('model = "hosek-wilkie"', 'model = "preetham"'), ("turbidity = 2", "turbidity = 11"),
    ("ground_albedo = 0.2", "ground_albedo = 2"), ("up = [0.0, 0.0, 1.0]", "up = 1"), ('file = "none.tif"', ""), ('on = "tangent"', 'on = "sea"'),
    ('has = "heights"', 'has = "depths"'), ("error_px = 1", "error_px = 0"), ("seen_from_m = [[0.0, 0.0, 100.0]]", "seen_from_m = [[0.0, 0.0]]"),
    ("seen_from_m = [[0.0, 0.0, 100.0]]", "seen_from_m = []"), ("budget_mib = 100", "budget_mib = 0"),
    ("detail = {posts = 4, craters_per_m2 = 0.08}", "detail = {craters_per_m2 = 0.08}"),
    ("detail = {posts = 4, craters_per_m2 = 0.08}", "detail = {posts = 1}"),
]


GOOD_SCENARIO = """
[scenario]
name = "s"
scene = "scene.toml"
duration_s = 400.0
pose_rate_hz = 20.0
seed = 1
[orbit]
model = "two-body"
radius_m = 6778137.0
up = [0.0, 0.0, 1.0]
along = [1.0, 0.0, 0.0]
[target]
body = "station"
mass_kg = 120000.0
inertia_kg_m2 = [6.0e6, 9.0e6, 9.0e6]
port = {position_m = [1.0, 0.0, 0.0], attitude_wxyz = [1.0, 0.0, 0.0, 0.0]}
with_lvlh = true
[chaser]
body = "chaser"
[start]
position_m = [25.0, 1.0, -0.8]
position_sigma_m = [0.5, 0.4, 0.4]
[thrusters]
force_n = 400.0
gain_sigma = 0.02
[attitude_sensor]
rate_sigma_deg_s = 0.002
[[leg]]
to_m = [0.0, 0.0, 0.0]
speed_m_s = 0.075
hold_s = 10
contact = true
[navigation]
cameras = ["nav"]
camera_method = "features"
period_s = 1.0
abort_sigma_m = 3.0
[model_error]
scale = 0.01
told = 1.0
[control]
damping = 0.9
[[fault]]
kind = "thruster_off"
from_s = 10
axis = "+fy"
[gates]
keep_out_m = 8.0
distance_m = [0.0, 100.0]
corridor = {half_angle_deg = 8.0, radius_m = 0.3}
navigation = {sigmas = 4.0, share = 0.99}
contact = {}
complete = true
"""
ITS_SCENE = """
[sun]
direction = [1, 0, 0]
[[body]]
name = "station"
sphere = {radius_m = 2}
can_id = 0x110
[[body]]
name = "chaser"
position_m = [30, 0, 0]
sphere = {radius_m = 1}
can_id = 0x100
[[camera]]
name = "nav"
mount = "chaser"
resolution = [64, 48]
fov_diagonal_deg = 30
rate_hz = 1
"""
BROKEN_SCENARIOS = [
    ('name = "s"', "name = 7"), ('name = "s"', ""), ('scene = "scene.toml"', ""), ('scene = "scene.toml"', "scene = 1"),
    ("duration_s = 400.0", "duration_s = 0"), ("duration_s = 400.0", "duration = 400.0"),
    ("duration_s = 400.0", "duration_s = 2e6"), ("pose_rate_hz = 20.0", "pose_rate_hz = 1001.0"), ("seed = 1", "seed = -1"),
    ("seed = 1", "seed = 1.5"), ('model = "two-body"', 'model = "three-body"'), ('model = "two-body"', 'model = "surface"'),
    ("radius_m = 6778137.0", "radius_m = -1"), ("radius_m = 6778137.0", "rotation_rad_s = 1e-5"),
    ("along = [1.0, 0.0, 0.0]", "along = 1.0"), ('body = "station"', ""), ('body = "chaser"', 'bodies = "chaser"'),
    ("mass_kg = 120000.0", "mass_kg = 0"), ("inertia_kg_m2 = [6.0e6, 9.0e6, 9.0e6]", "inertia_kg_m2 = [6.0e6, 9.0e6]"),
    ("with_lvlh = true", "with_lvlh = 1"), ("position_sigma_m = [0.5, 0.4, 0.4]", "position_sigma_m = [0.5, -0.4, 0.4]"),
    ("force_n = 400.0", 'force_n = "much"'), ("gain_sigma = 0.02", "gain_sigma = 0.6"),
    ("rate_sigma_deg_s = 0.002", "rate_sigma_deg_s = -0.002"), ("speed_m_s = 0.075", "speed_m_s = 0"),
    ("speed_m_s = 0.075", "velocity_m_s = 0.075"), ("hold_s = 10", "hold_s = 1e7"), ("contact = true", 'contact = "yes"'),
    ('cameras = ["nav"]', 'cameras = "nav"'), ('camera_method = "features"', 'camera_method = "sparse"'),
    ("period_s = 1.0", "period_s = 0.001"), ("abort_sigma_m = 3.0", "abort_sigma_m = 0"), ("scale = 0.01", "scale = -0.01"),
    ("told = 1.0", "tell = 1.0"), ("damping = 0.9", "damping = 11"), ('kind = "thruster_off"', 'kind = "gremlin"'),
    ('kind = "thruster_off"', 'kind = "commands_lost"'), ('kind = "thruster_off"', 'kind = "attitude_bias"'),
    ('kind = "thruster_off"', ""), ("from_s = 10", "from_s = -1"), ('axis = "+fy"', 'axis = "up"'), ('axis = "+fy"', ""),
    ("keep_out_m = 8.0", "keep_out_m = 0"), ("distance_m = [0.0, 100.0]", "distance_m = 100.0"),
    ("corridor = {half_angle_deg = 8.0, radius_m = 0.3}", "corridor = {half_angle_deg = 91.0}"),
    ("corridor = {half_angle_deg = 8.0, radius_m = 0.3}", "corridor = {half_angle = 8.0}"),
    ("navigation = {sigmas = 4.0, share = 0.99}", "navigation = {share = 1.5}"), ("contact = {}", "contact = 1"),
    ("complete = true", "complete = 1"), ("[target]", "[targets]"), ("[control]", "[controls]"), ("[start]", "[[start]]"),
]


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

    def test_each_broken_sky_and_terrain_is_refused_by_both(self):
        self.assertEqual(errors("scene", tomllib.loads(SKY)), [])
        self.assertIn("none.tif: no such file", self.accepted_by_narpa(SKY)[1])
        for line, wrong in BROKEN_SKY:
            self.assertNotIn("none.tif", self.refused("scene", SKY, line, wrong))


unittest.main(argv=sys.argv[:1])
