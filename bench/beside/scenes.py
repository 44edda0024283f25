"""Scenes that narpa, Cycles and POV-Ray all render: Lambert triangles, the Sun or lamps, one camera."""
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

SUN_IRRADIANCE = np.pi  # W m^-2: a white surface that faces the Sun has a radiance of 1
SUN_DIAMETER_DEG = 0.533


@dataclass
class Body:
    """Triangles whose corners index vertices, and a material for each of them: (albedo, emission), RGB."""

    name: str
    vertices: np.ndarray
    faces: np.ndarray
    materials: list
    material_of: np.ndarray


@dataclass
class Scene:
    name: str
    bodies: list
    position: tuple
    look_at: tuple
    up: tuple
    fov_deg: float
    sun: tuple | None = None  # direction to the Sun
    depth: int = 1  # surfaces that scatter the light of a path; 1: direct light
    shrink: int = 1  # by which the image is smaller than those of other scenes
    tuned: bool = True  # whether narpa's parameters were chosen with this scene in view

    def axes(self):
        """Right, up and forward of the camera."""
        forward = unit(np.subtract(self.look_at, self.position))
        right = unit(np.cross(forward, self.up))
        return right, np.cross(right, forward), forward


@dataclass
class Parts:
    """Collects the triangles of a body."""

    vertices: list = field(default_factory=list)
    faces: list = field(default_factory=list)
    material_of: list = field(default_factory=list)
    count: int = 0

    def add(self, vertices, faces, material):
        self.vertices.append(vertices)
        self.faces.append(np.asarray(faces) + self.count)
        self.material_of.append(np.full(len(faces), material))
        self.count += len(vertices)

    def box(self, low, high, material):
        corners = np.array([[(low, high)[k][a] for a, k in enumerate(c)] for c in np.ndindex(2, 2, 2)], float)
        quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
        self.add(corners, [t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))], material)

    def quad(self, a, b, c, d, material):
        self.add(np.array([a, b, c, d], float), [(0, 1, 2), (0, 2, 3)], material)

    def rod(self, begin, end, radius, material, sides=12):
        begin, end = np.asarray(begin, float), np.asarray(end, float)
        along = unit(end - begin)
        across = unit(np.cross(along, (1, 0, 0) if abs(along[0]) < 0.8 else (0, 1, 0)))
        angle = np.arange(sides) * 2 * np.pi / sides
        ring = radius * (np.outer(np.cos(angle), across) + np.outer(np.sin(angle), np.cross(along, across)))
        k, l = np.arange(sides), np.roll(np.arange(sides), -1)
        faces = np.concatenate([np.stack([k, l, k + sides], 1), np.stack([l, l + sides, k + sides], 1)])
        self.add(np.concatenate([begin + ring, end + ring]), faces, material)

    def body(self, name, materials):
        return Body(name, np.concatenate(self.vertices), np.concatenate(self.faces), materials, np.concatenate(self.material_of))


def unit(v):
    return np.asarray(v, float) / np.linalg.norm(v)


def grey(albedo):
    return (albedo,) * 3, (0.0,) * 3


def icosphere(subdivisions):
    """Vertices at distance 1 and faces of an icosahedron whose faces are cut in four so many times."""
    g = (1 + 5**0.5) / 2
    corners = np.array([(0, s, t * g) for s in (1, -1) for t in (1, -1)])
    vertices = np.concatenate([np.roll(corners, k, axis=1) for k in range(3)])
    distance = np.linalg.norm(vertices[:, None] - vertices[None], axis=2)
    near = np.abs(distance - 2) < 1e-6
    faces = [(i, j, k) for i in range(12) for j in range(i) for k in range(j) if near[i, j] and near[j, k] and near[k, i]]
    faces = np.array([(i, j, k) if np.linalg.det(vertices[[i, j, k]]) > 0 else (i, k, j) for i, j, k in faces])
    for _ in range(subdivisions):
        edges = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1)
        pairs, number = np.unique(edges, axis=0, return_inverse=True)
        middle = number.reshape(3, -1) + len(vertices)
        vertices = np.concatenate([vertices, vertices[pairs].mean(axis=1)])
        (a, b, c), (ab, bc, ca) = faces.T, middle
        faces = np.concatenate([np.stack(t, 1) for t in ((a, ab, ca), (b, bc, ab), (c, ca, bc), (ab, bc, ca))])
    return vertices / np.linalg.norm(vertices, axis=1, keepdims=True), faces


def rock(rng, subdivisions, roughness):
    """A sphere of radius 1 whose surface is displaced by waves of random directions."""
    vertices, faces = icosphere(subdivisions)
    height = np.zeros(len(vertices))
    for frequency in 1.5 ** np.arange(1, 3 * subdivisions - 3):
        waves = rng.normal(size=(8, 3)) * frequency
        height += np.sin(vertices @ waves.T + rng.uniform(0, 6.3, 8)).sum(axis=1) / frequency
    return vertices * (1 + roughness * height)[:, None], faces


def read_obj(path, scale=1.0):
    """The triangles of an OBJ file and the Kd and Ke of its MTL file. Reflections other than Lambert's are left out."""
    names, materials = {}, []
    for words in map(str.split, path.with_suffix(".mtl").read_text().splitlines()):
        if words[:1] == ["newmtl"]:
            names[words[1]] = len(materials)
            materials.append([(0.0,) * 3, (0.0,) * 3])
        elif words and words[0] in ("Kd", "Ke"):
            materials[-1][words[0] == "Ke"] = tuple(map(float, words[1:4]))
    vertices, faces, material_of, material = [], [], [], 0
    for words in map(str.split, path.read_text().splitlines()):
        if not words:
            continue
        if words[0] == "v":
            vertices.append([float(w) for w in words[1:4]])
        elif words[0] == "usemtl":
            material = names[words[1]]
        elif words[0] == "f":
            numbers = [int(w.split("/")[0]) for w in words[1:]]
            corners = [k - 1 if k > 0 else len(vertices) + k for k in numbers]  # below 0: counted from the newest vertex
            faces += [(corners[0], b, c) for b, c in zip(corners[1:], corners[2:])]
            material_of += [material] * (len(corners) - 2)
    return Body(path.stem, scale * np.array(vertices), np.array(faces), [tuple(m) for m in materials], np.array(material_of))


# --- The scenes ---


def craft(meshes):
    return Scene("craft", [read_obj(meshes / "craft/craft.obj")], (11, -4, 15), (0, 0, 0.6), (0, 0.8, 0.7), 27.4,
                 sun=(0.62, -0.48, 0.62))  # fmt: skip


def craft_and_ball(meshes, depth=1):
    ball, faces = icosphere(6)
    bodies = [read_obj(meshes / "craft/craft.obj"),
              Body("ball", 1.6 * ball + [2.6, 3.2, 1.2], faces, [grey(0.7)], np.zeros(len(faces), int))]  # fmt: skip
    return Scene(f"craft-and-ball{'' if depth == 1 else '-paths'}", bodies, (9, 9, 8), (0.8, 1.2, 0.6), (0, 0, 1), 36,
                 sun=(0.3, -0.6, 0.74), depth=depth)  # fmt: skip


def cornell(meshes):
    box = read_obj(meshes / "cornell/box.obj", 0.001)
    return Scene("cornell", [box], (0.278, 0.273, -0.8), (0.278, 0.273, 0), (0, 1, 0), 39.30765, depth=8, shrink=2)


def rubble(meshes):
    """A small body of 600 m and boulders on it, lit from the side."""
    rng = np.random.default_rng(1)
    parts = Parts()
    vertices, faces = rock(rng, 6, 0.08)
    ground = 100 * vertices * (1.3, 1.0, 0.9)
    parts.add(ground, faces, 0)
    for middle in ground[rng.choice(len(ground), 300, replace=False)]:
        stone, faces = rock(rng, 3, 0.15)
        size = 1.5 * rng.uniform() ** -0.5
        parts.add(middle + min(size, 18) * stone, faces, 1)
    return Scene("rubble", [parts.body("rubble", [grey(0.3), grey(0.4)])], (110, -640, 200), (0, 0, 0), (0, 0, 1), 27,
                 sun=(0.85, -0.4, 0.35), depth=5, tuned=False)  # fmt: skip


def module(meshes):
    """The inside of a station's module: racks of uneven depth, handrails, frames and eight lamps."""
    rng = np.random.default_rng(2)
    parts = Parts()
    wall, rack, metal, lamp = range(4)
    parts.box((0, -1.1, -1.1), (8, 1.1, 1.1), wall)
    for k in range(8):
        for side in (-1, 1):
            for level in range(3):
                depth, low = rng.uniform(0.1, 0.35), -1.05 + 0.7 * level
                sides = sorted((side * 1.1, side * (1.1 - depth)))
                parts.box((k + 0.04, sides[0], low), (k + 0.96, sides[1], low + 0.62), rack)
                height, face = low + rng.uniform(0.1, 0.5), side * (1.05 - depth)
                parts.rod((k + 0.2, face, height), (k + 0.8, face, height), 0.012, metal)
                for x in (k + 0.2, k + 0.8):
                    parts.rod((x, face, height), (x, side * (1.1 - depth), height), 0.009, metal)
        ring = [(k + 1.0, 1.0 * np.cos(a), 1.0 * np.sin(a)) for a in np.linspace(0, 2 * np.pi, 25)]
        for a, b in zip(ring, ring[1:]):
            parts.rod(a, b, 0.02, metal)
        y = 0.45 * (-1) ** k
        parts.box((k + 0.3, y - 0.12, 1.0), (k + 0.7, y + 0.12, 1.05), wall)
        parts.quad((k + 0.3, y - 0.12, 0.999), (k + 0.3, y + 0.12, 0.999), (k + 0.7, y + 0.12, 0.999), (k + 0.7, y - 0.12, 0.999), lamp)
    materials = [grey(0.75), ((0.6, 0.64, 0.7), (0.0,) * 3), grey(0.35), (grey(0.2)[0], (9.0, 8.5, 7.5))]
    return Scene("module", [parts.body("module", materials)], (0.15, 0.25, 0.1), (8, -0.1, -0.1), (0, 0, 1), 75, depth=8, shrink=2,
                 tuned=False)  # fmt: skip


SCENES = {"craft": craft, "craft-and-ball": craft_and_ball, "craft-and-ball-paths": lambda meshes: craft_and_ball(meshes, 5),
          "cornell": cornell, "rubble": rubble, "module": module}  # fmt: skip


def load(name, meshes):
    return SCENES[name](Path(meshes))
