"""The textures and the terrain of the gallery's scenes.

Maps are taken from a folder of real maps (earth-blue-marble.jpg, 2k_mars.jpg, lunar_surface_4096x2048.jpg; longitude across,
latitude up; missionDEM.tif: heights in metres, 1 m apart, north up). Missing maps are generated.
"""
from pathlib import Path

import cv2
import numpy as np

SIZE = (1024, 512)
REAL_MAPS = {"earth": "earth-blue-marble.jpg", "mars": "2k_mars.jpg", "moon": "lunar_surface_4096x2048.jpg"}


def make_all(folder, assets=None):
    """Writes all textures into the folder. Maps that the folder `assets` has are taken from there."""
    for name, make in {"earth": graticule, "mars": mars, "moon": moon}.items():
        real = Path(assets) / REAL_MAPS[name] if assets else None
        image = cv2.imread(str(real)) if real and real.exists() else make()
        cv2.imwrite(str(folder / f"{name}.png"), cv2.resize(image, (2048, 1024), interpolation=cv2.INTER_AREA))
    make_globe_maps(folder, Path(assets) if assets else None)
    cv2.imwrite(str(folder / "checker.png"), checker(16))
    heights = craters()
    cv2.imwrite(str(folder / "craters.png"), np.uint16(np.round(65535 * heights)))
    cv2.imwrite(str(folder / "crater_normals.png"), sphere_normals(heights, radius_m=1.0, height_m=0.06))
    dem = Path(assets) / "missionDEM.tif" if assets else None
    ground = cv2.imread(str(dem), cv2.IMREAD_UNCHANGED) if dem and dem.exists() else 35 * heights[90:427, 300:648] - 4475
    write_terrain(folder / "gale.obj", np.float64(ground) + 4460)


def make_globe_maps(folder, assets):
    """Writes maps of water, night lights and clouds. Clouds are generated. Water is where the height map is black."""

    def real(name):
        return cv2.imread(str(assets / name)) if assets and (assets / name).exists() else None

    heights, night = real("earth-topology.png"), real("earth-night.jpg")
    if heights is None:
        heights = np.repeat(255 * (clouds(8) > 0.55)[..., None], 3, axis=2).astype(np.uint8)
    if night is None:
        sparks = np.random.default_rng(9).random(SIZE[::-1]) ** 60 * (clouds(10) > 0.6)
        night = np.uint8(255 * sparks[..., None] * np.array([0.5, 0.8, 1.0]))
    water = cv2.GaussianBlur(np.uint8(255 * (heights[..., 0] < 3)), (3, 3), 0)
    lights = np.clip((np.float64(night[..., 2:]) - 36) * 3.5, 0, 255)  # remove the dim blue background of the continents
    lights = lights * np.array([0.55, 0.8, 1.0])
    for name, image in {"oceans": water, "earth_night": np.uint8(lights), "clouds": cloud_cover()}.items():
        cv2.imwrite(str(folder / f"{name}.png"), cv2.resize(image, (2048, 1024), interpolation=cv2.INTER_AREA))


def cloud_cover():
    """Streaks of noise, thicker along the equator and about 50 degrees north and south."""
    latitude = np.linspace(90, -90, SIZE[1])[:, None]
    belts = np.exp(-((latitude / 8) ** 2)) + np.exp(-(((np.abs(latitude) - 52) / 16) ** 2))
    noise = clouds(24, octaves=8, first=2)
    x = (np.arange(SIZE[0]) + np.int64(60 * clouds(22, octaves=5, first=1))) % SIZE[0]  # swirls
    y = np.clip(np.arange(SIZE[1])[:, None] + np.int64(40 * (clouds(23, octaves=5, first=1) - 0.5)), 0, SIZE[1] - 1)
    return np.uint8(255 * np.clip(4 * (noise[y, x] - 0.55 + 0.08 * belts), 0, 1))


def checker(squares):
    """Light and dark squares; the dark ones have another hue in the right half, so that the halves differ."""
    y, x = np.indices((512, 512)) * squares // 512
    dark = (x + y) % 2 == 1
    image = np.where(dark[..., None], (96, 60, 30), (235, 240, 245)).astype(np.uint8)
    image[dark & (x >= squares // 2)] = (40, 40, 150)
    return image


def graticule():
    """A generated map: parallels and meridians every 15 degrees, a colour for each octant, and names."""
    width, height = 2 * SIZE[0], 2 * SIZE[1]
    y, x = np.indices((height, width))
    image = np.empty((height, width, 3), np.uint8)
    image[..., 0] = np.where((x * 4 // width) % 2 == 0, 150, 110)
    image[..., 1] = np.where(y < height // 2, 120, 80)
    image[..., 2] = 40 + 150 * (x * 4 // width) // 3
    step = width // 24
    for i in range(24):
        cv2.line(image, (i * step, 0), (i * step, height), (220, 220, 220), 7 if i % 6 == 0 else 2)
    for i in range(1, 12):
        cv2.line(image, (0, i * step), (width, i * step), (220, 220, 220), 7 if i == 6 else 2)
    for i in range(0, 24, 2):
        east = 15 * i - 180
        name = str(abs(east)) if east in (0, -180) else f"{abs(east)}{'E' if east > 0 else 'W'}"
        cv2.putText(image, name, (i * step + 10, height // 2 - 12), cv2.FONT_HERSHEY_SIMPLEX, 1.3, (255, 255, 255), 3, cv2.LINE_AA)
        for j in (2, 4, 8, 10):
            north = 90 - 15 * j
            name = f"{abs(north)}{'N' if north > 0 else 'S'}"
            cv2.putText(image, name, (i * step + 10, j * step - 12), cv2.FONT_HERSHEY_SIMPLEX, 1.0, (255, 255, 255), 2, cv2.LINE_AA)
    return image


def clouds(seed, octaves=6, first=0):
    """Noise in 0..1 over a map, periodic in longitude. Octaves below `first` (the coarsest) are left out."""
    random = np.random.default_rng(seed)
    total = np.zeros(SIZE[::-1], np.float32)
    for octave in range(first, octaves):
        coarse = random.random((3 * 2**octave, 6 * 2**octave)).astype(np.float32)
        coarse = np.hstack([coarse, coarse[:, :1]])
        total += cv2.resize(coarse, SIZE, interpolation=cv2.INTER_CUBIC) / 1.7**octave
    return np.clip((total - total.min()) / np.ptp(total), 0, 1)


def mars():
    tone = clouds(3)[..., None]
    return np.uint8(np.array([45, 80, 130]) * (1 - tone) + np.array([95, 150, 215]) * tone)


def moon():
    tone = (0.55 * clouds(5) + 0.45 * craters())[..., None]
    return np.uint8(np.repeat(90 + 140 * tone, 3, axis=2))


def craters():
    """Heights in 0..1 of a cratered sphere."""
    random = np.random.default_rng(7)
    latitude, longitude = np.meshgrid(
        np.pi / 2 - (np.arange(SIZE[1]) + 0.5) * np.pi / SIZE[1],
        (np.arange(SIZE[0]) + 0.5) * 2 * np.pi / SIZE[0],
        indexing="ij",
    )
    points = np.stack([np.cos(latitude) * np.cos(longitude), np.cos(latitude) * np.sin(longitude), np.sin(latitude)], -1)
    heights = np.zeros(SIZE[::-1])
    for radius in np.sort(0.04 + 0.3 * random.random(90) ** 4)[::-1]:
        centre = random.normal(size=3)
        centre /= np.linalg.norm(centre)
        distance = np.arccos(np.clip(points @ centre, -1, 1)) / radius
        bowl = np.where(distance < 1, distance**2 - 1, 0) + 0.45 * np.exp(-(((distance - 1) / 0.22) ** 2))
        heights += radius * bowl
    return (heights - heights.min()) / np.ptp(heights)


def sphere_normals(heights, radius_m, height_m):
    """The tangent-space normal map of these heights on a sphere, from the slopes along east and north."""
    rows, columns = heights.shape
    latitude = np.pi / 2 - (np.arange(rows) + 0.5) * np.pi / rows
    east = (np.roll(heights, -1, 1) - np.roll(heights, 1, 1)) * height_m / 2
    east /= 2 * np.pi * radius_m / columns * np.cos(latitude)[:, None]
    north = -np.gradient(heights, axis=0) * height_m / (np.pi * radius_m / rows)
    normals = np.stack([np.ones_like(east), -north, -east], -1)  # blue, green, red
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    return np.uint16(np.round(65535 * (normals + 1) / 2))


def write_terrain(file, heights):
    """A mesh of the heights, 1 m apart: x along rows, y up the columns, origin in the middle."""
    rows, columns = heights.shape
    y, x = np.indices(heights.shape)
    corner = (y * columns + x + 1)[:-1, :-1].ravel()
    below, right = corner + columns, corner + 1
    with open(file, "w") as out:
        np.savetxt(out, np.stack([x.ravel() - (columns - 1) / 2, (rows - 1) / 2 - y.ravel(), heights.ravel()], 1), "v %.1f %.1f %.4f")
        np.savetxt(out, np.stack([corner, below, below + 1], 1), "f %d %d %d")
        np.savetxt(out, np.stack([corner, below + 1, right], 1), "f %d %d %d")
