"""narpa.Emulator: frames, ledgers and sweeps are those of `narpa run --lockstep` with the same commands."""
import os
import subprocess
import tempfile
import threading
import unittest
import zlib
from pathlib import Path

import needs

needs.compiled()

import narpa
import numpy as np
import program
from narpa import logs, y4m
from narpa.can import Catalogue, Decoder

# Commands of the chaser: a turn with velocity and rate, at times that are no multiples of the frames' period.
TIMES = [round(0.15 * k, 9) for k in range(6)]


def command_at(t):
    half = 0.1 * t
    return (0.2 * t, -0.1 * t, 0.3 * t), (np.cos(half), 0, np.sin(half), 0), (0.2, -0.1, 0.3), (0, 0.2, 0)


class Lockstep(unittest.TestCase):
    def setUp(self):
        self.kept = tempfile.TemporaryDirectory()
        self.folder = Path(self.kept.name)

    def tearDown(self):
        self.kept.cleanup()

    def run_of_the_program(self):
        """The log of `narpa run --lockstep`, which `narpa fly` commands over slcan."""
        trajectory = self.folder / "trajectory.csv"
        rows = [",".join(map(repr, (t, *map(float, sum(command_at(t), ()))))).replace(",", ",chaser,", 1) for t in TIMES]
        trajectory.write_text("t_s,body,x_m,y_m,z_m,qw,qx,qy,qz,vx_m_s,vy_m_s,vz_m_s,wx_rad_s,wy_rad_s,wz_rad_s\n"
                              + "\n".join(rows) + "\n")  # fmt: skip
        read, write = os.pipe()
        run = subprocess.Popen([program.NARPA, "run", program.SCENE, "--can", "slcan:0", "--lockstep", "--video",
                                f"nav={self.folder}/nav.y4m", "--lidar", "top=none", "--log", self.folder / "log", "--log-shots",
                                "--ready-fd", str(write)], pass_fds=[write], stderr=subprocess.PIPE, text=True)  # fmt: skip
        os.close(write)
        try:
            with os.fdopen(read) as ready:
                bus = next(line for line in ready if line.startswith("CAN=")).strip().removeprefix("CAN=")
            subprocess.run([program.NARPA, "fly", trajectory, "--can", bus, "--lockstep"], check=True, capture_output=True)
            _, said = run.communicate(timeout=600)
        finally:
            run.kill()
        self.assertEqual(run.returncode, 0, said)
        return self.folder / "log"

    def commanded(self, **arguments):
        emulator = narpa.Emulator(program.SCENE, **arguments)
        for t in TIMES:
            emulator.command("chaser", t, *command_at(t))
        return emulator

    def test_frames_ledgers_and_sweeps_are_those_of_the_program(self):
        log = self.run_of_the_program()
        reader = y4m.Reader(self.folder / "nav.y4m")
        frames = [np.array(frame) for frame in reader]
        reader.close()
        ledger = logs.read_table(log / "nav.ledger.csv")
        shots = np.genfromtxt(log / "top.shots.csv", delimiter=",", names=True, dtype=None, encoding=None)
        emulator = self.commanded()
        steps = [emulator.step(t) for t in (0.0, 0.05, 0.31, TIMES[-1])]  # in other steps than the commands
        steps.append(emulator.finish())
        made = [frame for step in steps for frame in step.frames]
        self.assertEqual(len(made), len(frames))
        self.assertEqual(len(made), 8)
        for frame, expected, row in zip(made, frames, ledger):
            np.testing.assert_array_equal(frame.dn, expected)
            for name in ledger.dtype.names:
                if name not in ("passes", "image_crc32"):
                    is_number = isinstance(row[name], np.floating)
                    value, logged = (np.float32(v) if is_number else v for v in (frame.ledger[name], row[name]))
                    self.assertEqual(value, logged, name)
            self.assertEqual(f"{zlib.crc32(frame.dn.tobytes()):08x}", row["image_crc32"])
        truth = logs.Run(log).truth("nav")
        for frame in made:
            position, _ = truth.at(frame.ledger["t_exposure_mid_ns"], "chaser")
            np.testing.assert_allclose(frame.poses["chaser"][:3, 3], position, atol=1e-15)
        fired = np.concatenate([sweep.shots for step in steps for sweep in step.sweeps])
        self.assertEqual(len(fired), len(shots))
        for name in fired.dtype.names:
            np.testing.assert_array_equal(fired[name], shots[name].astype(fired[name].dtype), name)

    def test_what_narpa_sends_on_can_comes_with_the_step(self):
        with self.commanded(lidars=[]) as emulator:
            decoder = Decoder(Catalogue())
            got = [m for identifier, data in emulator.step(0.3).can_frames if (m := decoder.accept(identifier, data))]
        self.assertEqual([m["Frame"] for m in got if m.name == "Ledger"], [0, 1, 2, 3])
        self.assertIn("Heartbeat", {m.name for m in got})
        self.assertEqual(emulator.report["cameras"][0]["frames"], 4)

    def test_steps_depend_on_commands(self):
        emulator = narpa.Emulator(program.SCENE, lidars=[])
        with self.assertRaisesRegex(narpa.Error, '"chaser" has no command'):
            emulator.step(0)
        emulator.command("chaser", 0, (0, 0, 0))
        self.assertEqual(len(emulator.step(0).frames), 1)
        with self.assertRaisesRegex(narpa.Error, "commanded up to 0 s, expected commands up to 1 s"):
            emulator.step(1)
        with self.assertRaisesRegex(narpa.Error, "times that increase"):
            emulator.command("chaser", 0, (0, 0, 0))
        with self.assertRaisesRegex(narpa.Error, "expected one of chaser"):
            emulator.command("ball", 1, (0, 0, 0))
        with self.assertRaisesRegex(narpa.Error, "pose at 2 s"):
            emulator.command("chaser", 2, (1e12, 0, 0))
        emulator.command("chaser", 0.25, (0, 0, 0.1))
        self.assertEqual([f.number for f in emulator.step(0.25).frames], [1, 2])
        self.assertEqual(emulator.time_s, 0.25)
        emulator.command("chaser", 200, (0, 0, 0.1))
        with self.assertRaisesRegex(narpa.Error, "60 s ahead"):
            emulator.step(200)
        emulator.finish()
        with self.assertRaisesRegex(narpa.Error, "finished"):
            emulator.step(0.25)

    def test_a_run_can_be_logged(self):
        with self.commanded(log=self.folder / "log", lidars=[]) as emulator:
            made = emulator.step(TIMES[-1]).frames
        ledger = logs.Run(self.folder / "log").ledger("nav")
        self.assertEqual(ledger["frame"].tolist(), [frame.number for frame in made])

    def test_several_at_once(self):
        emulators = [self.commanded(lidars=[]) for _ in range(3)]
        got = [None] * 3

        def fly(k):
            got[k] = [frame.dn.tobytes() for t in (0.2, TIMES[-1]) for frame in emulators[k].step(t).frames]

        threads = [threading.Thread(target=fly, args=(k,)) for k in range(3)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        self.assertEqual(len(got[0]), 8)
        self.assertEqual(got[1:], got[:1] * 2)

    def test_bad_scenes_are_errors(self):
        with self.assertRaises(narpa.SceneError):
            narpa.Emulator("no such scene")
        with self.assertRaisesRegex(narpa.Error, "can_id"):
            narpa.Emulator("cornell")
        with self.assertRaisesRegex(narpa.Error, "no camera named"):
            narpa.Emulator(program.SCENE, cameras=["nap"])


if __name__ == "__main__":
    unittest.main()
