"""narpa.load_scene: frames are those of `narpa render`, bit for bit; errors have places; threads and memory."""
import os
import resource
import tempfile
import threading
import time
import tomllib
import unittest
from pathlib import Path

import needs

needs.compiled()

import exr
import narpa
import numpy as np
import program

SOURCE = Path(__file__).resolve().parents[2]


def read_pfm(path):
    kind, size, scale, data = path.read_bytes().split(b"\n", 3)
    width, height = map(int, size.split())
    assert kind == b"PF" and float(scale) < 0
    return np.frombuffer(data, "<f4").reshape(height, width, 3)[::-1]


def memory_kb():
    """Resident memory of this process."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * resource.getpagesize() // 1024


class InAFolder(unittest.TestCase):
    def setUp(self):
        self.kept = tempfile.TemporaryDirectory()
        self.folder = Path(self.kept.name)

    def tearDown(self):
        self.kept.cleanup()


class Rendering(InAFolder):
    def rendered(self, name, *options):
        path = self.folder / name
        program.narpa("render", program.SCENE, "-o", path, *options)
        return path

    def test_digital_numbers_are_those_of_the_program(self):
        scene = narpa.load_scene(program.SCENE)
        for options, arguments in (
            ((), {}),
            (("--time", "1.3", "--spp", "3", "--seed", "5"), {"time_s": 1.3, "spp": 3, "seed": 5}),
            (("--frame", "7"), {"time_s": 0.7, "frame": 7}),
            ((), {}),  # again, after others
        ):
            frame = scene.render("nav", **arguments)
            expected = self.rendered("frame.raw", *options).read_bytes()
            self.assertEqual((frame.dn.shape, frame.dn.dtype), ((120, 160), np.uint8))
            self.assertEqual(frame.dn.tobytes(), expected, options)

    def test_each_format_has_its_shape(self):
        for pixel_format, shape, kind in (("Y16", (120, 160), np.uint16), ("RGB24", (120, 160, 3), np.uint8),
                                          ("YUYV", (120, 160, 2), np.uint8), ("RGGB16", (120, 160), np.uint16)):  # fmt: skip
            frame = narpa.load_scene(program.SCENE, {"camera.nav.format": pixel_format}).render()
            self.assertEqual((frame.dn.shape, frame.dn.dtype), (shape, kind))
            self.assertEqual(frame.dn.tobytes(), self.rendered("frame.raw", "--set", f"camera.nav.format={pixel_format}").read_bytes())

    def test_radiance_and_aovs_are_those_of_the_program(self):
        names = ("depth", "range", "normal", "position", "body", "albedo", "variance")
        frame = narpa.load_scene(program.SCENE).render(spp=4, aovs=names)
        np.testing.assert_array_equal(frame.radiance, read_pfm(self.rendered("frame.pfm", "--spp", "4")))
        file = exr.read(self.rendered("frame.exr", "--spp", "4", "--aov", ",".join(names)))
        for k, band in enumerate("RGB"):
            np.testing.assert_array_equal(frame.radiance[..., k], file[band])
            np.testing.assert_array_equal(frame["albedo"][..., k], file[f"albedo.{band}"])
        met = frame["body"] >= 0
        self.assertTrue(met.any() and not met.all())
        np.testing.assert_array_equal(frame["body"], file["body"])
        np.testing.assert_array_equal(frame["variance"], file["variance"])
        for name, channel in (("depth", "depth.Z"), ("range", "range")):
            values = frame[name]
            self.assertEqual(values.dtype, np.float64)
            self.assertTrue(np.isinf(values[~met]).all())
            np.testing.assert_array_equal(values.astype(np.float32), file[channel])
            rest = file[f"{channel}.rest"][met].astype(float)
            np.testing.assert_allclose(values[met], file[channel][met].astype(float) + rest, rtol=2.0**-47)
        for k, axis in enumerate("XYZ"):
            np.testing.assert_array_equal(frame["normal"][..., k].astype(np.float32), file[f"normal.{axis}"])
            np.testing.assert_array_equal(frame["position"][..., k].astype(np.float32), file[f"position.{axis}"])

    def test_placed_bodies_are_those_of_the_pose_option(self):
        scene = narpa.load_scene(program.SCENE)
        scene.render()
        position, attitude = program.POSE
        expected = self.rendered("frame.raw", "--pose", program.pose_option("chaser", program.POSE)).read_bytes()
        scene.place("chaser", position, attitude)
        self.assertEqual(scene.render().dn.tobytes(), expected)
        pose = scene.pose("chaser")
        np.testing.assert_allclose(pose[:3, 3], position)
        scene.place("chaser", np.zeros(3))
        self.assertNotEqual(scene.render().dn.tobytes(), expected)
        scene.place("chaser", pose)
        np.testing.assert_allclose(scene.pose("chaser"), pose, atol=1e-15)
        differs = scene.render().dn != np.frombuffer(expected, np.uint8).reshape(120, 160)  # the attitude's last bit may
        self.assertLess(differs.mean(), 0.01)
        scene.place("chaser", position, attitude, velocity_m_s=(0, 0, 1))
        np.testing.assert_allclose(scene.pose("chaser", 0.5)[:3, 3], np.add(position, (0, 0, 0.5)))

    def test_a_camera_can_be_placed(self):
        scene = narpa.load_scene(program.SCENE)
        before = scene.render().dn
        in_world = scene.camera_pose("nav")
        scene.place_camera("nav", in_world)  # on the world, where it was on the chaser
        np.testing.assert_array_equal(scene.render().dn, before)
        scene.place("chaser", (0, 0, 0.5))
        np.testing.assert_allclose(scene.camera_pose("nav"), in_world)
        scene.place_camera("nav", (0.03, 0, 0.05), mount="chaser")
        np.testing.assert_allclose(scene.camera_pose("nav")[:3, 3], (0.03, 0, 0.55))

    def test_what_is_in_the_scene(self):
        scene = narpa.load_scene(program.SCENE)
        self.assertEqual((scene.name, scene.bodies), ("bench", ["bay", "ball", "buoy", "chaser"]))
        self.assertEqual((scene.cameras, scene.lidars), (["nav"], ["top"]))
        camera = scene.camera("nav")
        self.assertEqual((camera.width, camera.height, camera.format, camera.mount), (160, 120, "GREY", "chaser"))
        self.assertEqual(scene.render(spp=3).ledger["budget"], 3)

    def test_arrays_outlive_the_scene(self):
        scene = narpa.load_scene(program.SCENE)
        first, second = scene.render(aovs=["depth"]), scene.render(frame=1)
        self.assertFalse(np.array_equal(first.dn, second.dn), "the noise differs")
        copy, depth = first.dn.copy(), first["depth"].copy()
        del scene
        np.testing.assert_array_equal(first.dn, copy)
        np.testing.assert_array_equal(first["depth"], depth)


class Dictionaries(InAFolder):
    def test_a_dictionary_is_a_scene_file(self):
        document = tomllib.loads(program.SCENE.read_text())
        scene = narpa.load_scene(document, folder=program.SCENE.parent)
        np.testing.assert_array_equal(scene.render().dn, narpa.load_scene(program.SCENE).render().dn)

    def test_arrays_and_overrides(self):
        document = tomllib.loads(program.SCENE.read_text())
        document["body"][1]["position_m"] = np.array([0.4, -0.1, 3])
        scene = narpa.load_scene(document, {"camera.nav.resolution": (80, 60), "body.ball.position_m": np.array([0.3, 0, 3])},
                                 folder=program.SCENE.parent)  # fmt: skip
        self.assertEqual(scene.render().dn.shape, (60, 80))
        np.testing.assert_allclose(scene.pose("ball")[:3, 3], (0.3, 0, 3))
        self.assertEqual(repr(scene), f'<narpa.Scene "{scene.name}": bodies {scene.bodies}, cameras {scene.cameras}, lidars {scene.lidars}>'.replace("'", ""))
        with self.assertRaisesRegex(TypeError, "overrides: expected a dict such as"):
            narpa.load_scene(document, ["camera.nav.resolution=[80, 60]"], folder=program.SCENE.parent)


class Errors(InAFolder):
    def error_of(self, text):
        path = self.folder / "bad.toml"
        path.write_text(text)
        with self.assertRaises(narpa.SceneError) as caught:
            narpa.load_scene(path)
        self.assertEqual(caught.exception.file, str(path))
        return caught.exception

    def test_errors_have_file_line_and_column(self):
        error = self.error_of('[scene]\nname = "x"\n\n[sun]\n  irradiance = 3\n')
        self.assertEqual((error.line, error.column), (5, 3))
        self.assertIn("irradiance_w_m2", str(error))
        error = self.error_of("[scene\n")
        self.assertEqual(error.line, 1)

    def test_errors_of_a_dictionary_count_in_its_text(self):
        document = {"scene": {"name": "x"}, "sun": {"direction": [0, 0, 1], "irradiance": 3}}
        with self.assertRaises(narpa.SceneError) as caught:
            narpa.load_scene(document)
        error = caught.exception
        self.assertEqual((error.file, error.line), ("<dict>", 6))
        self.assertEqual(narpa.toml.dumps(document).splitlines()[error.line - 1], "irradiance = 3")
        with self.assertRaisesRegex(TypeError, "body: expected a dict"):
            narpa.load_scene({"body": 3})

    def test_wrong_arguments_are_named(self):
        with self.assertRaisesRegex(narpa.SceneError, "did you mean .docking."):
            narpa.load_scene("dockin")
        with self.assertRaisesRegex(narpa.SceneError, "detektor"):
            narpa.load_scene(program.SCENE, {"camera.nav.detektor.bits": 12})
        scene = narpa.load_scene(program.SCENE)
        for wrong, expected in (
            (lambda: scene.render("nap"), "no camera named"),
            (lambda: scene.render(aovs=["deep"]), "depth, range"),
            (lambda: scene.render(spp=0), "spp 0"),
            (lambda: scene.render(time_s=float("nan")), "time nan"),
            (lambda: scene.place("chasr", (0, 0, 0)), "did you mean"),
            (lambda: scene.place("chaser", (0, 0, 0), (1, 1, 0, 0)), "norm 1"),
            (lambda: scene.place("chaser", np.diag([1, 1, -1, 1])), "rotation"),
            (lambda: scene.place("chaser", np.eye(3)), r"\(4, 4\)"),
            (lambda: scene.place_camera("nav", (0, 0, 0), mount="none"), "no body named"),
            (lambda: scene.scan("nap"), "no LiDAR named"),
        ):
            with self.assertRaisesRegex(narpa.Error, expected):
                wrong()


class Threads(unittest.TestCase):
    def test_other_threads_run_while_it_renders(self):
        scene = narpa.load_scene(program.SCENE)
        scene.render()
        counted, stop = 0, threading.Event()
        begun = threading.Event()

        def render():
            begun.set()
            scene.render(spp=300)
            stop.set()

        thread = threading.Thread(target=render)
        thread.start()
        begun.wait()
        waiting = threading.Thread(target=scene.pose, args=("chaser",))  # for its turn
        waiting.start()
        while not stop.is_set():  # with the GIL held, this thread would get no turn during the one call
            counted += 1
            time.sleep(0.001)
        thread.join()
        waiting.join()
        self.assertGreater(counted, 10)

    def test_threads_take_turns(self):
        scene = narpa.load_scene(program.SCENE)
        expected = [scene.render(frame=k).dn.tobytes() for k in range(4)]
        got = [None] * 4

        def render(k):
            for _ in range(3):
                got[k] = scene.render(frame=k).dn.tobytes()

        threads = [threading.Thread(target=render, args=(k,)) for k in range(4)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        self.assertEqual(got, expected)


class Memory(unittest.TestCase):
    def test_it_stays_flat_over_many_frames(self):
        scene = narpa.load_scene(program.SCENE)

        def frames(first, n):
            for k in range(first, first + n):
                scene.place("chaser", (0, 0, 0.001 * k))
                scene.render(frame=k, aovs=["depth", "position"])

        frames(0, 50)
        before = memory_kb()
        frames(50, 300)
        self.assertLess(memory_kb() - before, 4096, "kB; a frame with its AOVs has 2 MB")


if __name__ == "__main__":
    unittest.main()
