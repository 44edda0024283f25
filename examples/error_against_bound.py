#!/usr/bin/python3
"""Compares the error of the pose estimator with the Cramer-Rao bound, over frames that differ only in their noise.

Usage: error_against_bound.py [FRAMES]      FRAMES: number of noise seeds, default 20

An efficient estimator has an RMS error near the bound: the ratio is about 1. PYTHONPATH as in python/README.md.
"""
import sys

import narpa
import numpy as np

frames = int(sys.argv[1]) if len(sys.argv) > 1 else 20
# A detector with 1000 electrons of noise: with the scene's 13 the bound is so low that the sampling noise of the renders, which
# it does not include, exceeds it.
scene = narpa.load_scene("docking", {"camera.nav.resolution": [160, 128], "camera.nav.detector.read_noise_e": 1000})
scene.place("chaser", position_m=(20, 0.5, -0.4), attitude_wxyz=(0, 0, 0, 1))

position_m, rotation_rad, bounds = [], [], []
for seed in range(frames):
    frame = scene.render("nav", spp=16, seed=seed)
    found = narpa.estimate(scene, "nav", frame.dn, method="dense", target="station", seed=seed)
    print(f"seed {seed:3d}: {found.answer:12s} {found.why}", end="")
    if found.passed:
        position_m.append(found.error_position_m)
        rotation_rad.append(found.error_rotation_rad)
        bounds.append(found.bound)
        print(f"off by {1e3 * found.error_position_m:6.2f} mm, {1e3 * found.error_rotation_rad:6.3f} mrad", end="")
    print()

if not bounds:
    sys.exit("no frame gave a pose")
bound = np.mean(bounds, axis=0)
for name, errors, variance in (
    ("rotation, mrad", rotation_rad, np.trace(bound[:3, :3])),
    ("position, mm", position_m, np.trace(bound[3:, 3:])),
):
    rms = 1e3 * np.sqrt(np.mean(np.square(errors)))
    limit = 1e3 * np.sqrt(variance)
    print(f"{name}: RMS error {rms:.3f}, Cramer-Rao bound {limit:.3f}, ratio {rms / limit:.2f}")
