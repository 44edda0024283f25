#!/usr/bin/python3
"""Finds the exposure time of the docking camera: renders the same view with exposures from 50 us to 3.2 ms.

Usage: exposure_sweep.py [SCENE]      SCENE: a scene file or name, default docking; its first camera needs a detector

Prints for each exposure the mean and the largest digital number, and the share of saturated pixels. PYTHONPATH as in
python/README.md.
"""
import sys

import narpa
import numpy as np

scene_name = sys.argv[1] if len(sys.argv) > 1 else "docking"
camera = narpa.load_scene(scene_name).cameras[0]
best = None

print("exposure_ms    mean_dn  largest_dn  saturated")
for exposure_s in 5e-5 * 2.0 ** np.arange(7):
    # The exposure belongs to the scene's detector: each is a scene of its own, as with `narpa render --set`.
    scene = narpa.load_scene(scene_name, {f"camera.{camera}.detector.exposure_s": float(exposure_s)})
    dn = scene.render(camera, spp=4).dn
    saturated = np.mean(dn == dn.max()) if dn.max() == np.iinfo(dn.dtype).max else 0.0
    print(f"{1e3 * exposure_s:11.3f} {dn.mean():10.2f} {dn.max():11d} {saturated:9.2%}")
    if saturated < 0.001:
        best = exposure_s

print(f"longest exposure with less than 0.1 % saturated pixels: {1e3 * best:.3f} ms" if best else "every exposure saturates")
