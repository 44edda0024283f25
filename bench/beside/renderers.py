"""narpa, Cycles and POV-Ray as renderers of the same scenes. Each is a context with render(rung, seed): image, wall and CPU time.

The time is that of a frame of a scene that is already loaded: of narpa, radiance and digital image; of Cycles, the second and later
renders with persistent data; of POV-Ray, its own "Trace Time".
"""
import json
import os
import re
import shutil
import subprocess
import time
from pathlib import Path

os.environ["OPENCV_IO_ENABLE_OPENEXR"] = "1"  # before OpenCV is loaded
import cv2
import numpy as np

from .scenes import SUN_DIAMETER_DEG, SUN_IRRADIANCE


def read_image(path):
    image = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    return image[:, :, 2::-1].astype(float)  # RGB


class Narpa:
    """Rungs: ("spp", samples per pixel) and ("rays", rays per pixel)."""

    name = "narpa"

    def __init__(self, scene, size, threads, folder):
        import narpa

        self.pixels, self.threads, self.loaded = size * size, threads, {}
        self.load = narpa.load_scene
        self.path = folder / "scene.toml"
        for body in scene.bodies:
            self.write_mesh(body, folder)
        self.path.write_text(self.toml(scene, size))

    @staticmethod
    def write_mesh(body, folder):
        with (folder / f"{body.name}.mtl").open("w") as out:
            for k, (albedo, emission) in enumerate(body.materials):
                out.write(f"newmtl m{k}\nKd %r %r %r\n" % tuple(map(float, albedo)))
                if any(emission):
                    out.write("Ke %r %r %r\n" % tuple(map(float, emission)))
        with (folder / f"{body.name}.obj").open("w") as out:
            out.write(f"mtllib {body.name}.mtl\n")
            out.write("".join("v %.9g %.9g %.9g\n" % tuple(v) for v in body.vertices))
            for k in range(len(body.materials)):
                out.write(f"usemtl m{k}\n" + "".join("f %d %d %d\n" % tuple(f) for f in body.faces[body.material_of == k] + 1))

    @staticmethod
    def toml(scene, size):
        sun = f"""[sun]
direction = {list(scene.sun)}
irradiance_w_m2 = {SUN_IRRADIANCE}
angular_diameter_deg = {SUN_DIAMETER_DEG}
""" if scene.sun else ""  # fmt: skip
        bodies = "".join(f'[[body]]\nname = "{b.name}"\nmesh = "{b.name}.obj"\n' for b in scene.bodies)
        return sun + bodies + f"""[[camera]]
name = "camera"
position_m = {list(scene.position)}
look_at = {list(scene.look_at)}
up = {list(scene.up)}
resolution = [{size}, {size}]
fov_horizontal_deg = {scene.fov_deg}
format = "GREY"
white_radiance = 1.0
[render]
""" + (f'method = "path"\nmax_depth = {scene.depth}\n' if scene.depth > 1 else 'method = "direct"\n')  # fmt: skip

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.loaded.clear()

    def render(self, rung, seed):
        kind, number = rung
        if rung not in self.loaded:
            key = {"spp": "render.spp", "rays": "render.budget_rays"}[kind]
            self.loaded[rung] = self.load(self.path, {key: number * (self.pixels if kind == "rays" else 1)}, threads=self.threads)
            self.loaded[rung].render("camera")  # allocates
        wall, cpu = time.perf_counter(), time.process_time()
        frame = self.loaded[rung].render("camera", frame=seed)
        return np.array(frame.radiance, float), time.perf_counter() - wall, time.process_time() - cpu


class Cycles:
    """Rungs: ("spp", samples per pixel)."""

    name = "Cycles"

    def __init__(self, scene, size, threads, folder):
        for body in scene.bodies:
            np.savez(folder / f"{body.name}.npz", vertices=body.vertices, faces=body.faces, material_of=body.material_of)
        sun = scene.sun and {"direction": scene.sun, "irradiance": SUN_IRRADIANCE, "diameter_deg": SUN_DIAMETER_DEG}
        about = {"size": size, "threads": threads, "position": scene.position, "axes": [a.tolist() for a in scene.axes()],
                 "fov_deg": scene.fov_deg, "depth": scene.depth, "sun": sun,
                 "bodies": {b.name: b.materials for b in scene.bodies}}  # fmt: skip
        (folder / "scene.json").write_text(json.dumps(about))
        self.folder = folder

    @staticmethod
    def missing():
        return None if shutil.which("blender") else "no blender: install Blender (Debian: blender)"

    def __enter__(self):
        self.process = subprocess.Popen(
            ["blender", "-b", "--factory-startup", "--python", Path(__file__).with_name("blender_side.py"), "--", self.folder],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)  # fmt: skip
        self.render(("spp", 1), 0)  # builds its hierarchy
        return self

    def __exit__(self, *_):
        self.process.stdin.close()
        self.process.wait()

    def render(self, rung, seed):
        out = self.folder / "cycles.exr"
        self.process.stdin.write(json.dumps({"spp": rung[1], "seed": seed, "out": str(out)}) + "\n")
        self.process.stdin.flush()
        for line in self.process.stdout:
            if line.startswith("DONE "):
                used = json.loads(line[5:])
                return read_image(out), used["wall_s"], used["cpu_s"]
        raise RuntimeError(f"blender ended with exit status {self.process.wait()}")


class PovRay:
    """Rungs: ("grid", n): n x n rays in each pixel, except in those that are as their neighbours. Direct light of the Sun alone."""

    name = "POV-Ray"

    def __init__(self, scene, size, threads, folder):
        self.size, self.threads, self.folder = size, threads, folder
        (folder / "scene.pov").write_text("".join(self.pieces(scene)))

    @staticmethod
    def missing():
        return None if shutil.which("povray") else "no povray: install POV-Ray (Debian: povray)"

    @staticmethod
    def pieces(scene):
        def vector(v):
            return "<%.9g,%.9g,%.9g>" % tuple(v)

        right, up, forward = scene.axes()
        width = 2 * np.tan(np.radians(scene.fov_deg) / 2)
        yield "#version 3.7;\nglobal_settings { assumed_gamma 1.0 }\n#default { finish { ambient 0 diffuse 1 } }\n"
        yield (f"camera {{ location {vector(scene.position)} up {vector(width * up)} right {vector(width * right)} "
               f"direction {vector(forward)} }}\n")  # fmt: skip
        sun = scene.sun / np.linalg.norm(scene.sun)
        across = np.cross(sun, (0, 0, 1))
        across /= np.linalg.norm(across)
        distance = 1e5
        disc = 2 * distance * np.tan(np.radians(SUN_DIAMETER_DEG) / 2)
        yield (f"light_source {{ {vector(distance * sun)} color rgb 1 #if (SunGrid > 1) area_light {vector(disc * across)}, "
               f"{vector(disc * np.cross(sun, across))}, SunGrid, SunGrid circular jitter #end }}\n")  # fmt: skip
        for body in scene.bodies:
            yield f"mesh2 {{ vertex_vectors {{ {len(body.vertices)}, {','.join(map(vector, body.vertices))} }}\n"
            textures = "".join(f"texture {{ pigment {{ color rgb {vector(albedo)} }} }}" for albedo, _ in body.materials)
            yield f"texture_list {{ {len(body.materials)}, {textures} }}\n"
            faces = ",".join(f"{vector(f)},{m}" for f, m in zip(body.faces, body.material_of))
            yield f"face_indices {{ {len(body.faces)}, {faces} }} }}\n"

    def __enter__(self):
        return self

    def __exit__(self, *_):
        pass

    def render(self, rung, seed):
        n, out = rung[1], self.folder / "povray.png"
        done = subprocess.run(
            ["povray", "+Iscene.pov", f"+O{out.name}", f"+W{self.size}", f"+H{self.size}", f"+WT{self.threads}", "-D", "+FN16",
             "File_Gamma=1.0", *(["+AM1", "+A0.0", f"+R{n}", "+J"] if n > 1 else ["-A"]),
             f"Declare=SunGrid={2 if n > 1 else 1}"],
            cwd=self.folder, capture_output=True, text=True, check=True)  # fmt: skip
        wall = re.search(r"Trace Time:.*\(([\d.]+) seconds\)", done.stderr)
        cpu = re.search(r"Trace Time:[^\n]*\n[^\n]*with ([\d.]+) CPU-seconds", done.stderr)
        return read_image(out) / 65535, float(wall[1]), float(cpu[1])
