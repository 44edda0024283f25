#!/usr/bin/python3
"""Test patterns of a camera, as receivers in Python get them by UDP and as Y4M, against narpa.pixels, which computes them anew."""
import threading
import time

import numpy as np

import support
from support import expect

from narpa import datagrams, pixels  # noqa: E402  (support sets the path)

SIZE, FRAMES = (64, 48), 5
SCENE = """
[sun]
direction = [-1, 0.5, 0.7]
[[body]]
name = "target"
sphere = {{radius_m = 2}}
[[camera]]
name = "nav"
position_m = [-10, 0, 0]
attitude_wxyz = [0.5, -0.5, 0.5, -0.5]
resolution = [{0[0]}, {0[1]}]
fov_horizontal_deg = 40
rate_hz = 10
format = "{1}"
test_pattern = "{2}"
{4}
[camera.detector]
bits = {3}
exposure_s = 0.001
"""


def expected(pattern, frame, bits):
    return pixels.test_pattern(pattern, frame, SIZE[0] * SIZE[1], bits).reshape(SIZE[::-1])


def check(folder, pattern, pixel_format, bits, link="", in_y4m=True):
    scene, video = folder / "scene.toml", folder / "nav.y4m"
    scene.write_text(SCENE.format(SIZE, pixel_format, pattern, bits, link))
    port, came = support.free_port(), []
    threading.Thread(target=lambda: came.extend(datagrams.receive(port, "127.0.0.1")), daemon=True).start()
    sinks = ["--video", f"nav=udp:127.0.0.1:{port}"] + (["--video", f"nav={video}"] if in_y4m else [])
    support.narpa("run", scene, *sinks, "--duration", FRAMES / 10)
    time.sleep(1)  # the receiver has what came
    expect(len(came) > 0, f"{pixel_format}, {pattern}: {len(came)} frames came")
    for frame in came:
        good = np.array_equal(frame.pixels, expected(pattern, frame.header.frame, bits))
        expect(good and frame.lost == 0, f"{pixel_format}, {pattern}: frame {frame.header.frame} is what it is computed to be")
    if not video.exists():
        return
    kind = np.uint8 if bits == 8 else "<u2"
    for number, data in enumerate(support.read_y4m(video)[: len(came)]):
        values = np.frombuffer(data, kind).reshape(SIZE[::-1])
        expect(any(np.array_equal(values, expected(pattern, k, bits)) for k in range(number, FRAMES)), f"Y4M, frame {number}")
    video.unlink()


folder = support.work_folder()
for pattern in ("counter", "prbs"):
    check(folder, pattern, "GREY", 8)
    check(folder, pattern, "Y12", 12)
    check(folder, pattern, "Y10P", 10, in_y4m=False)
    check(folder, pattern, "Y12", 12, 'byte_order = "big"\nrow_bytes = 160', in_y4m=False)
    check(folder, pattern, "GREY", 8, "row_bytes = 65", in_y4m=False)
