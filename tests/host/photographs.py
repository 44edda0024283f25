#!/usr/bin/python3
"""Photographs of a chessboard by a webcam with a wide lens: narpa against OpenCV's own calibration.

The 13 photographs are those of Debian's package opencv-doc. The board is modelled as a plane with a texture, without a background.
`calibrate` finds OpenCV's camera from a start with a wrong focal length and no distortion; `estimate` finds OpenCV's poses within the
covariances that it states; `compare` finds the render at OpenCV's pose in the photograph. With a folder as argument, files are kept there, and
dense estimates all 13 photographs.
"""
import json
import sys
import tempfile
from pathlib import Path

from support import expect, narpa, skip

try:
    import cv2
    import numpy as np
except ImportError as error:
    skip(f"{error}: apt-get install python3-opencv")

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "python"))
from narpa import rotation

PHOTOGRAPHS = sorted(Path("/usr/share/doc/opencv-doc/examples/data").glob("left[0-9][0-9].jpg"))
COLUMNS, ROWS, SQUARE_M = 9, 6, 0.025  # inner corners
WIDTH, HEIGHT = 640, 480
PARAMETERS = ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3")
HEADER = "t_s,body,x_m,y_m,z_m,qw,qx,qy,qz,vx_m_s,vy_m_s,vz_m_s,wx_rad_s,wy_rad_s,wz_rad_s\n"
# Half a window of cornerSubPix. In the smallest image, squares are 22 px wide: with 11 px, as in OpenCV's example, windows
# hold other corners, and poses are up to 0.7 degrees off.
HALF_WINDOW_PX = 8


def corners_in(image):
    found, corners = cv2.findChessboardCorners(image, (COLUMNS, ROWS))
    expect(found, "OpenCV finds the board")
    return cv2.cornerSubPix(image, corners, (HALF_WINDOW_PX, HALF_WINDOW_PX), (-1, -1), (3, 100, 1e-4))


def calibrate_by_opencv(images):
    """Values and standard deviations of PARAMETERS; (position m, quaternion) of the board in each image."""
    board = np.array([[x, y, 0] for y in range(ROWS) for x in range(COLUMNS)], np.float32) * SQUARE_M
    corners = [corners_in(image) for image in images]
    _, matrix, distortion, turns, shifts, sigmas, _, _ = cv2.calibrateCameraExtended([board] * len(images), corners, (WIDTH, HEIGHT), None, None)
    values = [matrix[0, 0], matrix[1, 1], matrix[0, 2], matrix[1, 2], *distortion.ravel()]
    poses = [(shift.ravel(), rotation.from_vector(turn.ravel())) for turn, shift in zip(turns, shifts)]
    return np.array(values), sigmas.ravel()[: len(PARAMETERS)], poses


def write_board(folder):
    """The squares and those beyond the outer corners as far as they are printed: 0.45 of their width."""
    texel = 64
    squares = np.fromfunction(lambda v, u: (u // texel + v // texel) % 2, ((ROWS + 1) * texel, (COLUMNS + 1) * texel))
    cv2.imwrite(str(folder / "board.png"), np.where(squares > 0, 255, 89).astype(np.uint8))  # sRGB: 89 is a tenth of the light
    low, right, bottom = -0.45, COLUMNS - 0.55, ROWS - 0.55
    lines = ["mtllib board.mtl", "usemtl board"]
    for x, y in ((low, low), (right, low), (right, bottom), (low, bottom)):
        lines += [f"v {x * SQUARE_M} {y * SQUARE_M} 0", f"vt {(x + 1) / (COLUMNS + 1)} {1 - (y + 1) / (ROWS + 1)}"]
    (folder / "board.obj").write_text("\n".join([*lines, "f 1/1 4/4 3/3 2/2", ""]))
    (folder / "board.mtl").write_text("newmtl board\nKd 1 1 1\nmap_Kd board.png\n")


def write_scene(path, camera):
    path.write_text(f"""[scene]
name = "board"
[ambient]
radiance = 300.0
[[body]]
name = "board"
mesh = "board.obj"
can_id = 0x100
[[camera]]
name = "webcam"
resolution = [{WIDTH}, {HEIGHT}]
format = "GREY"
white_radiance = 330.0
{camera}
""")


def pose_text(position, attitude):
    return "board=" + ",".join(f"{x:.12f}" for x in (*position, *attitude))


def displaced(pose, random, degrees, part):
    """Off in attitude and, by a part of the range, in position, in random directions."""
    position, attitude = pose
    turn, shift = (v / np.linalg.norm(v) for v in random.normal(size=(2, 3)))
    return position + part * np.linalg.norm(position) * shift, rotation.product(rotation.from_vector(np.radians(degrees) * turn), attitude)


def calibrate(folder, values, sigmas, poses):
    """From a focal length 10 % too long, the middle of the image, no distortion, and poses 1.5 degrees and 1.5 % off: further off, the
    board's squares would be matched with their neighbours."""
    focal = 1.1 * values[0]
    write_scene(folder / "start.toml", f"intrinsics = {{fx = {focal}, fy = {focal}, cx = {WIDTH / 2 - 0.5}, cy = {HEIGHT / 2 - 0.5}}}")
    random = np.random.default_rng(1)
    with open(folder / "starts.csv", "w") as file:
        file.write(HEADER)
        for i, pose in enumerate(poses):
            position, attitude = displaced((pose[0] * [1, 1, 1.1], pose[1]), random, 1.5, 0.015)
            file.write(f"{i},board," + ",".join(f"{x:.9f}" for x in (*position, *attitude, 0, 0, 0, 0, 0, 0)) + "\n")
    said = narpa("calibrate", folder / "start.toml", *PHOTOGRAPHS, "--trajectory", folder / "starts.csv", "-o", folder / "camera", "--json")
    print(said.stderr.decode())
    report = json.loads(said.stdout)
    expect(report["passed"] and sum(i["used"] for i in report["images"]) >= 12, "calibrate uses at least 12 of 13 photographs, and settles")
    off_mm = [1e3 * np.linalg.norm(np.array(i["pose"]["position_m"]) - pose[0]) for i, pose in zip(report["images"], poses) if i["used"]]
    expect(max(off_mm) < 4, f"poses are at most {max(off_mm):.1f} mm off OpenCV's, with another focal length")
    expect([p["name"] for p in report["parameters"]] == list(PARAMETERS), "all parameters are estimated")
    for p, value, sigma in zip(report["parameters"], values, sigmas):
        off = abs(p["value"] - value) / np.hypot(p["sigma"], sigma)
        print(f"| `{p['name']}` | {p['start']:.5g} | {value:.6g} +- {sigma:.2g} | {p['value']:.6g} +- {p['sigma']:.2g} | {off:.1f} |")
        expect(off < 3 and p["determined"], f"{p['name']} agrees with OpenCV's: {off:.1f} of both sigmas off")
    file = cv2.FileStorage(str(folder / "camera/webcam.yaml"), cv2.FILE_STORAGE_READ)
    matrix, distortion = file.getNode("camera_matrix").mat(), file.getNode("distortion_coefficients").mat()
    expect(abs(matrix[0, 0] - report["parameters"][0]["value"]) < 1e-6 and distortion.size == 5, "OpenCV reads the camera")
    return report


# What a plane with two brightnesses lacks: light that is not the same everywhere, the webcam's tone curve and sharpening.
DENSE = ("--method", "dense", "--uncertainty", "detail=0.3,albedo=0.3,focal=0.001")


def write_board_scene(folder, values):
    """With OpenCV's camera."""
    fx, fy, cx, cy, *distortion = values
    write_scene(folder / "board.toml", f"intrinsics = {{fx = {fx}, fy = {fy}, cx = {cx}, cy = {cy}}}\n"
                f"distortion = {{model = \"opencv\", coefficients = {distortion}}}")  # fmt: skip


def estimate(folder, photographs, poses, method, least):
    """From starts 2 degrees and 2 % off OpenCV's poses; at least so many are good."""
    rows = []
    print("| photograph | answer | matches | error deg | sigma deg | error mm | sigma mm | NEES |")
    for photograph, pose in zip(photographs, poses):
        said = narpa("estimate", folder / "board.toml", "--frame", photograph, "--pose", pose_text(*pose), *method, "--json", status=None)
        answer = json.loads(said.stdout)
        row = {"answer": answer["answer"]["class"], "why": answer["answer"]["why"], "matches": answer.get("matches", 0)}
        if "nees" in answer:
            covariance = np.array(answer["covariance"])
            row |= {"deg": np.degrees(answer["error_rotation_rad"]), "sigma_deg": np.degrees(np.sqrt(np.trace(covariance[:3, :3]))),
                    "mm": 1e3 * answer["error_position_m"], "sigma_mm": 1e3 * np.sqrt(np.trace(covariance[3:, 3:])), "nees": answer["nees"]}  # fmt: skip
        rows.append(row)
        numbers = [f"{x:.2g}" if isinstance(x, float) else str(x) for key, x in row.items() if key != "why" or x]
        print(f"| {photograph.name} | {' | '.join(numbers)} |")
    good = [r for r in rows if r["answer"] == "good"]
    expect(len(good) >= least, f"{len(good)} of {len(rows)} poses are good")
    nees = np.array([r["nees"] for r in good])
    expect(nees.mean() < 12 and nees.max() < 50, f"NEES against OpenCV's poses: mean {nees.mean():.1f}, median {np.median(nees):.1f}, largest {nees.max():.1f}")


def compare(folder, poses):
    """The last photograph, in which white is not clipped."""
    said = narpa("compare", folder / "board.toml", "--only-target", "--frame", PHOTOGRAPHS[-1], "--pose", pose_text(*poses[-1]),
                 "-o", folder / "compare.png", "--min-correlation", "0.95", "--max-shift", "0.5", "--json")  # fmt: skip
    found = json.loads(said.stdout)
    shift = found["shift"]
    expect(found["passed"], f"photograph and render: correlation {found['correlation']:.3f}, shift {shift['x_px']:.2f}, {shift['y_px']:.2f} px")


if not PHOTOGRAPHS:
    skip("no photographs of a chessboard: apt-get install opencv-doc")
expect(len(PHOTOGRAPHS) == 13, "opencv-doc has 13 photographs")
with tempfile.TemporaryDirectory() as name:
    work = Path(sys.argv[1] if len(sys.argv) > 1 else name)
    work.mkdir(exist_ok=True)
    write_board(work)
    found_values, found_sigmas, found_poses = calibrate_by_opencv([cv2.imread(str(p), cv2.IMREAD_GRAYSCALE) for p in PHOTOGRAPHS])
    write_board_scene(work, found_values)
    estimate(work, PHOTOGRAPHS, found_poses, ("--method", "features"), 11)
    some = slice(None) if len(sys.argv) > 1 else slice(2, None, 5)  # 10 CPU seconds each
    estimate(work, PHOTOGRAPHS[some], found_poses[some], DENSE, 2)
    calibrate(work, found_values, found_sigmas, found_poses)
    compare(work, found_poses)
