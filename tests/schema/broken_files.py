"""Valid scenes and scenarios, and lines of them with what makes each wrong: (line, wrong line)."""
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
"""

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
    ("fov_horizontal_deg = 20", "fov_deg = 20"), ('format = "Y16"', 'format = "Y11"'), ("rate_hz = 5", "rate_hz = 1e5"),
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

# A recipe of a data set of ITS_SCENE.
GOOD_RECIPE = """
[dataset]
name = "r"
scene = "scene.toml"
set = ["render.spp=1"]
camera = "nav"
target = "station"
seed = 1
outputs = ["mask"]
[pose]
range_m = {kind = "log_uniform", between = [2.0, 8.0]}
margin = 0.1
point_m = [0.0, 0.0, 1.0]
[pose.attitude]
kind = "cone"
axis = [1.0, 0.0, 0.0]
half_angle_deg = 30.0
roll_deg = {between = [-5.0, 5.0]}
[illumination]
phase_deg = {kind = "choice", values = [10.0, 20.0]}
[exposure]
time_factor = {between = [0.5, 2.0]}
[surface]
albedo_factor = {between = [0.5, 1.5]}
[[variant]]
name = "v"
weight = 2.0
[[background]]
kind = "none"
weight = 1.0
[keypoints]
count = 8
"""

BROKEN_RECIPES = [
    ('name = "r"', "name = 7"), ('name = "r"', ""), ('scene = "scene.toml"', ""), ('scene = "scene.toml"', "scene = 1"),
    ('set = ["render.spp=1"]', 'set = "render.spp=1"'), ('camera = "nav"', 'cameras = "nav"'), ('target = "station"', "target = 1"),
    ("seed = 1", "seed = -1"), ("seed = 1", "seed = 1.5"), ('outputs = ["mask"]', 'outputs = "mask"'),
    ('range_m = {kind = "log_uniform", between = [2.0, 8.0]}', "range_m = 2.0"),
    ('range_m = {kind = "log_uniform", between = [2.0, 8.0]}', 'range_m = {kind = "log_uniform", between = [0.0, 8.0]}'),
    ('range_m = {kind = "log_uniform", between = [2.0, 8.0]}', 'range_m = {kind = "normal", between = [2.0, 8.0]}'),
    ('range_m = {kind = "log_uniform", between = [2.0, 8.0]}', 'range_m = {kind = "uniform", values = [2.0, 8.0]}'),
    ('range_m = {kind = "log_uniform", between = [2.0, 8.0]}', 'range_m = {between = [2.0]}'),
    ("margin = 0.1", "margin = 0.6"), ("margin = 0.1", "margins = 0.1"), ("point_m = [0.0, 0.0, 1.0]", "point_m = [0.0, 1.0]"),
    ('kind = "cone"', 'kind = "pyramid"'), ('kind = "cone"', 'kind = "uniform"'), ("axis = [1.0, 0.0, 0.0]", ""),
    ("half_angle_deg = 30.0", "half_angle_deg = 181.0"), ("half_angle_deg = 30.0", ""),
    ("roll_deg = {between = [-5.0, 5.0]}", "roll_deg = 5.0"), ('phase_deg = {kind = "choice", values = [10.0, 20.0]}', 'phase_deg = {kind = "choice"}'),
    ("time_factor = {between = [0.5, 2.0]}", 'time_factor = "long"'), ("albedo_factor = {between = [0.5, 1.5]}", "albedo = {between = [0.5, 1.5]}"),
    ('name = "v"', ""), ("weight = 2.0", "weight = 0"), ('kind = "none"', 'kind = "earth"'), ('kind = "none"', 'kind = "body"'),
    ('kind = "none"', ""), ("weight = 1.0", "weight = -1.0"), ("count = 8", "count = 0"), ("count = 8", "number = 8"),
]  # fmt: skip
