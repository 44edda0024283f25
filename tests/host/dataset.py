#!/usr/bin/python3
"""`narpa dataset`: shards equal a whole run byte for byte, a run that was killed goes on, and the labels describe the images:
poses by OpenCV's solvePnP, masks and boxes by an own reader of COCO's format, and SPEED+'s convention of quaternions."""
import filecmp
import json
import subprocess
import time

import support
from support import NARPA, expect, narpa

try:
    import cv2, numpy as np  # noqa: E401
except ImportError as error:
    support.skip(f"{error} (python3-opencv)")

IMAGES = 12
DRAWN = ("statistics.png", "contact_sheet.png")  # by matplotlib
folder = support.work_folder()
recipe = folder / "recipe.toml"
recipe.write_text(f"""[dataset]
name = "bench"
scene = "{support.SCENE}"
camera = "nav"
target = "bay"
seed = 5
set = ["camera.nav.distortion={{model=\\"opencv\\",coefficients=[-0.12,0.03,0.001,-0.0008]}}"]
outputs = ["mask", "depth", "normals", "radiance"]
[pose]
range_m = {{ kind = "log_uniform", between = [3.0, 12.0] }}
margin = 0.2
[illumination]
phase_deg = {{ between = [0.0, 100.0] }}
[exposure]
time_factor = {{ kind = "log_uniform", between = [0.5, 2.0] }}
gain_factor = {{ kind = "choice", values = [1.0, 1.5] }}
[surface]
albedo_factor = {{ between = [0.6, 1.2] }}
[[variant]]
name = "dim"
set = ["ambient.radiance=1.0"]
[[variant]]
name = "bright"
[[background]]
kind = "none"
[[background]]
kind = "scene"
[[background]]
kind = "body"
body = "buoy"
[keypoints]
count = 16
""")
whole = folder / "whole"


def files(of):
    return sorted(str(p.relative_to(of)) for p in of.rglob("*") if p.is_file() and p.name not in DRAWN)


def expect_same(other, what):
    expect(files(other) == files(whole), f"{what}: the same files")
    different = [f for f in files(whole) if not filecmp.cmp(whole / f, other / f, shallow=False)]
    expect(not different, f"{what}: the same bytes {different}")


def labels():
    return [json.loads((whole / f"labels/{i:06d}.json").read_text()) for i in range(IMAGES)]


def rotation(q):
    w, x, y, z = q
    return np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                     [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                     [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]])  # fmt: skip


def check_whole_run():
    said = json.loads(narpa("dataset", recipe, "-n", IMAGES, "-o", whole, "--threads", 2, "--verify", IMAGES, "--json").stdout)
    expect(said["made"] == IMAGES and said["gathered"] and said["passed"] and len(said["verified"]) == IMAGES, "12 images are made and verified")
    for name, suffix in (("images", "png"), ("masks", "png"), ("depth", "pfm"), ("normals", "pfm"), ("radiance", "exr"), ("labels", "json")):
        expect(sorted(p.name for p in (whole / name).iterdir()) == [f"{i:06d}.{suffix}" for i in range(IMAGES)], f"each image has a file in {name}")
    drawn = {(label["variant"], label["background"]) for label in labels()}
    expect(len(drawn) > 3, f"images differ in variant and background: {sorted(drawn)}")
    again = json.loads(narpa("dataset", recipe, "-n", IMAGES, "-o", whole, "--json").stdout)
    expect(again["made"] == 0 and again["gathered"], "the same command makes no image again")


def check_shards():
    """On any number of threads, in any order, and of a larger data set."""
    shards = folder / "shards"
    for k in (3, 1, 2):
        said = json.loads(narpa("dataset", recipe, "-n", IMAGES, "-o", shards, "--shard", f"{k}/3", "--threads", k, "--json").stdout)
        expect(said["gathered"] == (k == 2) and said["made"] == 4, f"shard {k} of 3 makes 4 images; the last one gathers: {said}")
    expect_same(shards, "shards")
    grown = folder / "grown"
    narpa("dataset", recipe, "-n", 5, "-o", grown)
    narpa("dataset", recipe, "-n", 4, "-o", grown, status=2)
    narpa("dataset", recipe, "-n", IMAGES, "-o", grown)
    expect_same(grown, "a data set that has grown")


def check_kill_and_resume():
    killed = folder / "killed"
    command = [NARPA, "dataset", str(recipe), "-n", str(IMAGES), "-o", str(killed), "--threads", "1"]
    process = subprocess.Popen(command, stderr=subprocess.DEVNULL)
    while process.poll() is None and len(list(killed.glob("labels/0*.json"))) < 3:
        time.sleep(0.005)
    process.kill()
    process.wait()
    there = {p.name: p.stat().st_mtime_ns for p in killed.glob("labels/0*.json")}
    expect(len(there) >= 3, f"killed after {len(there)} images")
    if len(there) < IMAGES:
        narpa("dataset", recipe, "-o", killed, "--gather", status=1)
    (killed / "masks/.part-elsewhere-1-000002.png").write_text("left by a killed process")
    narpa("dataset", recipe, "-n", IMAGES, "-o", killed)
    kept = {name: (killed / "labels" / name).stat().st_mtime_ns for name in there}
    expect(kept == there, "what was complete was not made again")
    expect_same(killed, "a run that was killed and started again")
    (killed / "masks/000004.png").unlink()
    narpa("dataset", recipe, "-o", killed, "--gather", status=1)
    narpa("dataset", recipe, "-n", IMAGES, "-o", killed)
    expect_same(killed, "a data set whose mask was lost")
    narpa("dataset", recipe, "-o", killed, "--gather")
    expect_same(killed, "gathered again")


def check_poses():
    """The pose that OpenCV finds from the keypoints that are in the image is the label's, and reprojects to 0.01 px."""
    checked = 0
    for label in labels():
        camera = label["camera"]
        K, distortion = np.array(camera["camera_matrix"], float), np.array(camera["distortion_coefficients"], float)
        seen = [k for k in label["keypoints"] if k["state"] == "visible"]
        points, px = np.array([k["position_m"] for k in seen]), np.array([k["px"] for k in seen])
        q, t = np.array(label["T_camera_target"]["attitude_wxyz"]), np.array(label["T_camera_target"]["position_m"])
        turn = cv2.Rodrigues(rotation(q))[0]
        if len(seen):
            off = np.abs(cv2.projectPoints(points, turn, t, K, distortion)[0].reshape(-1, 2) - px).max()
            expect(off < 0.01, f"image {label['image']}: {len(seen)} visible keypoints reproject to {off:.2g} px")
        if len(seen) < 6 or np.linalg.svd(points - points.mean(0))[1][2] < 0.2:
            continue  # too few, or in one plane
        _, found_turn, found_t = cv2.solvePnP(points, px, K, distortion, flags=cv2.SOLVEPNP_SQPNP)
        found_turn, found_t = cv2.solvePnPRefineLM(points, px, K, distortion, found_turn, found_t)
        off = np.abs(cv2.projectPoints(points, found_turn, found_t, K, distortion)[0].reshape(-1, 2) - px).max()
        apart = np.linalg.norm(cv2.Rodrigues(found_turn)[0] - rotation(q)), np.linalg.norm(found_t.ravel() - t)
        expect(off < 0.01 and apart[0] < 1e-4 and apart[1] < 1e-3, f"image {label['image']}: solvePnP finds the label's pose: {off:.2g} px, {apart}")
        checked += 1
    expect(checked >= 3, f"{checked} poses by solvePnP")


def check_maps():
    """Masks, depth and normals agree with each other and with the label."""
    at_surface = []
    for label in labels():
        name = f"{label['image']:06d}"
        mask = cv2.imread(str(whole / f"masks/{name}.png"), cv2.IMREAD_UNCHANGED)
        depth = cv2.imread(str(whole / f"depth/{name}.pfm"), cv2.IMREAD_UNCHANGED)
        normals = cv2.imread(str(whole / f"normals/{name}.pfm"), cv2.IMREAD_UNCHANGED)[..., ::-1]  # to x, y, z
        image = cv2.imread(str(whole / f"images/{name}.png"), cv2.IMREAD_UNCHANGED)
        ids = {b["id"] for b in label["bodies"]}
        if not (set(np.unique(mask)) <= ids | {0} and np.isfinite(depth[mask > 0]).all() and np.isinf(depth[mask == 0]).all()):
            expect(False, f"image {name}: mask {np.unique(mask)} and depth agree")
        lengths = np.linalg.norm(normals, axis=-1)
        if not (np.abs(lengths[mask > 0] - 1).max() < 1e-5 and (lengths[mask == 0] == 0).all() and image.shape == mask.shape):
            expect(False, f"image {name}: normals are unit vectors on bodies")
        rows, columns = np.nonzero(mask)
        K, d = np.array(label["camera"]["camera_matrix"], float), np.array(label["camera"]["distortion_coefficients"], float)
        rays = cv2.undistortPoints(np.stack([columns, rows], 1).astype(float)[:, None], K, d).reshape(-1, 2)
        towards = -(rays[:, 0] * normals[rows, columns, 0] + rays[:, 1] * normals[rows, columns, 1] + normals[rows, columns, 2])
        if towards.min() < -1e-3:
            expect(False, f"image {name}: normals face the camera: {towards.min()}")
        for body in label["bodies"]:
            own = mask == body["id"]
            if own.sum() != body["area_px"]:
                expect(False, f"image {name}: {body['name']} has {own.sum()} pixels, its label {body['area_px']}")
        for point in label["keypoints"]:
            if point["state"] != "visible":
                continue
            x, y = (int(round(c)) for c in point["px"])
            near = depth[max(0, y - 1):y + 2, max(0, x - 1):x + 2]
            z = (rotation(label["T_camera_target"]["attitude_wxyz"]) @ point["position_m"] + label["T_camera_target"]["position_m"])[2]
            if np.isfinite(near).any():
                at_surface.append(near.min() - 0.02 * z < z < near.max() + 0.02 * z)
        # The range and phase angle of the label are those of its pose and Sun.
        sun = np.array(label["sun_direction_camera"])
        if abs(np.linalg.norm(sun) - 1) > 1e-12 or not 0 <= label["phase_deg"] <= 100 or not 3 <= label["range_m"] <= 12:
            expect(False, f"image {name}: Sun {sun}, phase {label['phase_deg']}, range {label['range_m']}")
    expect(len(at_surface) > 20 and np.mean(at_surface) > 0.9, f"{len(at_surface)} visible points, {np.mean(at_surface):.3f} of them at the depth of their pixels")
    expect(True, "masks, depth, normals and areas agree")


def mesh():
    """Corners of the target's triangles, n x 3 x 3."""
    lines = [line.split() for line in (support.SCENE.parent / "bay.obj").read_text().splitlines()]
    vertices = np.array([line[1:4] for line in lines if line[:1] == ["v"]], float)
    faces = [[int(corner.split("/")[0]) - 1 for corner in line[1:]] for line in lines if line[:1] == ["f"]]
    return np.array([vertices[[f[0], f[k], f[k + 1]]] for f in faces for k in range(1, len(f) - 1)])


def distances(points, triangles):
    """From each point to the plane of the nearest triangle that it lies above, to 1 mm at the edges; infinite above none."""
    best = np.full(len(points), np.inf)
    for a, b, c in triangles:
        normal = np.cross(b - a, c - a)
        if not normal.any():
            continue
        weights = np.linalg.lstsq(np.stack([b - a, c - a], 1), (points - a).T, rcond=None)[0]
        above = (weights >= -1e-3).all(0) & (weights.sum(0) <= 1 + 1e-3)
        best[above] = np.minimum(best[above], np.abs((points[above] - a) @ normal) / np.linalg.norm(normal))
    return best


def check_pose_by_depth():
    """Depth and mask, taken to the target's axes by the labelled pose, lie on the target's mesh as its file has it."""
    triangles, worst, pixels = mesh(), 0, 0
    for label in labels():
        name = f"{label['image']:06d}"
        mask = cv2.imread(str(whole / f"masks/{name}.png"), cv2.IMREAD_UNCHANGED)
        depth = cv2.imread(str(whole / f"depth/{name}.pfm"), cv2.IMREAD_UNCHANGED)
        rows, columns = np.nonzero(mask == label["target_id"])
        K, d = np.array(label["camera"]["camera_matrix"], float), np.array(label["camera"]["distortion_coefficients"], float)
        criteria = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 100, 1e-12)
        px = np.stack([columns, rows], 1).astype(float)[:, None]
        rays = cv2.undistortPointsIter(px, K, d, None, None, criteria).reshape(-1, 2)
        z = depth[rows, columns].astype(float)
        camera = np.stack([rays[:, 0] * z, rays[:, 1] * z, z], 1)
        own = (camera - label["T_camera_target"]["position_m"]) @ rotation(label["T_camera_target"]["attitude_wxyz"])
        off = distances(own, triangles)
        worst, pixels = max(worst, off.max(initial=0)), pixels + len(off)
    expect(worst < 1e-5 and pixels > 5000, f"{pixels} depths lie within {worst:.2g} m of the target's mesh at the labelled poses")


def decode(segmentation):
    """Run-length encoding down the columns; numbers in groups of 5 bits, from the third on as differences to the last but one."""
    runs, number, bits = [], 0, 0
    for c in segmentation["counts"]:
        group = ord(c) - 48
        number |= (group & 31) << bits
        bits += 5
        if not group & 32:
            number -= (group >> 4 & 1) << bits
            runs.append(number + (runs[-2] if len(runs) > 2 else 0))
            number = bits = 0
    flat = np.repeat(np.arange(len(runs)) % 2, runs)
    return flat.reshape(segmentation["size"], order="F")


def check_coco():
    coco = json.loads((whole / "coco.json").read_text())
    expect([i["id"] for i in coco["images"]] == list(range(IMAGES)) and all((whole / i["file_name"]).is_file() for i in coco["images"]), "COCO names the images")
    categories = {c["id"]: c for c in coco["categories"]}
    by_name = {c["name"]: c for c in coco["categories"]}
    expect(len(by_name["bay"]["keypoints"]) == 16 and "keypoints" not in by_name["buoy"], "keypoints belong to the target's category")
    expect(len({a["id"] for a in coco["annotations"]}) == len(coco["annotations"]), "annotations have numbers of their own")
    masks = {}
    for a in coco["annotations"]:
        mask = masks.setdefault(a["image_id"], cv2.imread(str(whole / f"masks/{a['image_id']:06d}.png"), cv2.IMREAD_UNCHANGED))
        own = mask == a["category_id"]
        x, y, w, h = cv2.boundingRect(own.astype(np.uint8))
        if not ((decode(a["segmentation"]) == own).all() and a["bbox"] == [x, y, w, h] and a["area"] == own.sum()):
            expect(False, f"annotation {a['id']}: mask, box and area are those of the mask's file")
        if categories[a["category_id"]]["name"] != "bay":
            continue
        label = json.loads((whole / f"labels/{a['image_id']:06d}.json").read_text())
        points = np.array(a["keypoints"]).reshape(-1, 3)
        flags = [{"visible": 2, "occluded": 1, "outside": 0}[k["state"]] for k in label["keypoints"]]
        inside = np.array([k["px"] if f else [0, 0] for k, f in zip(label["keypoints"], flags)])
        if points[:, 2].tolist() != flags or np.abs(points[:, :2] - inside).max() > 1e-9 or a["num_keypoints"] != sum(f > 0 for f in flags):
            expect(False, f"annotation {a['id']}: keypoints")
    expect(len(coco["annotations"]) > IMAGES, f"{len(coco['annotations'])} annotations have the masks, boxes, areas and keypoints of their images")
    shown = {(i, b) for i, m in masks.items() for b in np.unique(m) if b}
    expect(shown == {(a["image_id"], a["category_id"]) for a in coco["annotations"]}, "each body that an image shows has one")


def check_speed():
    """SPEED+ as its users read it: C = passive DCM of q (scalar first), camera axes to target axes; p_camera = C^T p + r."""
    camera, train = (json.loads((whole / f"{n}.json").read_text()) for n in ("camera", "train"))
    expect(camera["Nu"] == support.WIDTH and camera["Nv"] == support.HEIGHT and camera["distCoeffs"] == [-0.12, 0.03, 0.001, -0.0008, 0], f"camera.json: {camera}")
    for entry, label in zip(train, labels()):
        q0, q1, q2, q3 = entry["q_vbs2tango_true"]
        C = np.array([[2 * q0**2 - 1 + 2 * q1**2, 2 * (q1 * q2 + q0 * q3), 2 * (q1 * q3 - q0 * q2)],
                      [2 * (q1 * q2 - q0 * q3), 2 * q0**2 - 1 + 2 * q2**2, 2 * (q2 * q3 + q0 * q1)],
                      [2 * (q1 * q3 + q0 * q2), 2 * (q2 * q3 - q0 * q1), 2 * q0**2 - 1 + 2 * q3**2]])  # fmt: skip
        for k in label["keypoints"]:
            if k["px"] is None or k["state"] == "outside":
                continue
            p = C.T @ k["position_m"] + entry["r_Vo2To_vbs_true"]
            px = cv2.projectPoints(p[None], np.zeros(3), np.zeros(3), np.array(camera["cameraMatrix"], float), np.array(camera["distCoeffs"]))[0].ravel()
            if np.abs(px - k["px"]).max() > 0.01:
                expect(False, f"{entry['filename']}: {px} is {k['px']}")
    expect(len(train) == IMAGES and all((whole / "images" / e["filename"]).is_file() for e in train), "SPEED+ labels project the keypoints to 0.01 px")


def check_statistics():
    document = json.loads((whole / "statistics.json").read_text())
    ranges = [label["range_m"] for label in labels()]
    h = document["histograms"]["range_m"]
    expect(sum(h["counts"]) == IMAGES and len(h["edges"]) == len(h["counts"]) + 1, "each image is counted")
    expect(abs(h["mean"] - np.mean(ranges)) < 1e-12 and h["least"] == min(ranges) and h["greatest"] == max(ranges), "ranges are those of the labels")
    empty = sum(b["area_px"] == 0 for label in labels() for b in label["bodies"] if b["name"] == "bay")
    expect(document["empty_images"] == empty, f"{empty} images are empty")
    brightness = np.mean([cv2.imread(str(whole / f"images/{i:06d}.png"), cv2.IMREAD_UNCHANGED).mean() / 255 for i in range(IMAGES)])
    expect(abs(document["histograms"]["brightness"]["mean"] - brightness) < 1e-6, f"images have a mean of {brightness:.4f}")


def check_wrong_labels():
    """Verification finds a label that does not describe its image."""
    file = whole / "labels/000003.json"
    good = file.read_text()

    def wrong(change, what):
        label = json.loads(good)
        change(label)
        file.write_text(json.dumps(label))
        said = json.loads(narpa("dataset", recipe, "-o", whole, "--verify", IMAGES, "--json", status=1).stdout)
        failed = [v["image"] for v in said["verified"] if not v["passed"]]
        expect(failed == [3] and not said["passed"], f"verification finds {what}")

    def farther(label):
        label["T_camera_target"]["position_m"] = [1.01 * x for x in label["T_camera_target"]["position_m"]]

    def conjugated(label):
        w, *xyz = label["T_camera_target"]["attitude_wxyz"]
        label["T_camera_target"]["attitude_wxyz"] = [w, *(-x for x in xyz)]

    def moved(label):
        inside = next(k for k in label["keypoints"] if k["px"])
        inside["px"][0] += 0.02

    def turned(label):
        label["sun_direction_camera"][0] *= -1

    wrong(farther, "a range that is 1 % off")
    wrong(conjugated, "a quaternion of the inverse rotation")
    wrong(moved, "a keypoint that is 0.02 px off")
    wrong(turned, "a Sun on the other side")
    file.write_text("{}")
    narpa("dataset", recipe, "-o", whole, "--verify", IMAGES, status=2)
    file.write_text(good)
    narpa("dataset", recipe, "-o", whole, "--verify", 3)


def check_scene_alone():
    out = folder / "scene"
    narpa("dataset", support.SCENE, "-n", 2, "-o", out, "--verify", 2)
    label = json.loads((out / "labels/000001.json").read_text())
    expect(label["target"] == "bay" and len(label["keypoints"]) == 11, "a scene alone has the recipe's defaults")
    said = narpa("dataset", recipe, "-n", 2, "-o", out, status=2).stderr.decode()
    expect("is of another recipe" in said, f"a folder keeps its recipe: {said}")
    expect("nothing to do" in narpa("dataset", recipe, "-o", out, status=2).stderr.decode(), "without -n there is something to do")
    expect("expected K/M" in narpa("dataset", recipe, "-n", 2, "-o", out, "--shard", "3/2", status=2).stderr.decode(), "shards are checked")
    expect('did you mean "docking"' in narpa("dataset", "dokcing", "-n", 1, "-o", out, status=2).stderr.decode(), "misspelt names are suggested")
    document = json.loads(narpa("check", recipe, "--json").stdout)
    expect(document["dataset"]["name"] == "bench" and document["scene"]["cameras"], "check takes a recipe, and its scene")


check_whole_run()
check_shards()
check_kill_and_resume()
check_poses()
check_maps()
check_pose_by_depth()
check_coco()
check_speed()
check_statistics()
check_wrong_labels()
check_scene_alone()
