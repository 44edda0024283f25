"""The emulator in lockstep within Python: narpa.Emulator."""
from . import toml
from .compiled import _narpa
from .scenes import arguments_of

EmulatedFrame = _narpa.EmulatedFrame
EmulatedSweep = _narpa.EmulatedSweep
Step = _narpa.Step
for kind in (EmulatedFrame, EmulatedSweep, Step):
    kind.__module__ = "narpa"


class Emulator:
    """`narpa run --lockstep` within this process: poses in, frames, sweeps and ledgers out.

    The clock stands still between steps. Frames are byte for byte those of `narpa run --lockstep` with the same commands:
    poses go through the same CAN messages, with their rounding.

        with narpa.Emulator("docking") as emulator:
            emulator.command("chaser", 0.0, (20, 0, 0), (0, 0, 0, 1))
            emulator.command("chaser", 1.0, (19, 0, 0), (0, 0, 0, 1))
            for frame in emulator.step(1.0).frames:
                print(frame.camera, frame.time_s, frame.dn.mean())

    source, overrides, folder, threads: as of narpa.load_scene. cameras, lidars: names of those that run; None: all.
    log: folder for the log of the run (docs/replay.md), which replaces an earlier one; None: no log.

    Raises narpa.SceneError for the scene, narpa.Error for a scene without a body that has a can_id, without sensors, or with
    a time budget.
    """

    def __init__(self, source, overrides=None, *, cameras=None, lidars=None, log=None, folder=".", threads=0):
        name, text = arguments_of(source, folder)
        self._session = _narpa.EmulatorSession(name, text, toml.overrides_of(overrides), cameras, lidars, str(log or ""), threads)
        self.report = None

    @property
    def time_s(self):
        """Simulation time that the clock has reached, s."""
        return self._session.time_s

    def command(self, body, time_s, position_m, attitude_wxyz=(1, 0, 0, 0), velocity_m_s=(0, 0, 0), rate_rad_s=(0, 0, 0)):
        """Commands the pose of a body at a time: between commands the body moves as docs/interfaces.md states.

        time_s: increases from command to command of a body. position_m: (3,) world axes. attitude_wxyz: body to world.
        velocity_m_s: (3,) world axes. rate_rad_s: (3,) body axes.
        """
        self._session.command(body, time_s, position_m, attitude_wxyz, velocity_m_s, rate_rad_s)

    def send(self, identifier, data):
        """Sends a CAN frame (8 bytes or fewer: classic, else FD), for example a camera's command that narpa.can has encoded."""
        self._session.send(identifier, data)

    def step(self, to_s):
        """Advances the clock to this time and returns what was made, as a narpa.Step.

        Every commanded body needs a command for this time or later; otherwise narpa.Error. Ctrl-C ends a step early.
        """
        return self._session.step(to_s)

    def finish(self):
        """Ends the run: writes the log, sets `report` (the JSON document of `narpa run`), returns the rest as a narpa.Step,
        with the sweeps that are not whole."""
        rest, self.report = self._session.finish()
        return rest

    def __enter__(self):
        return self

    def __exit__(self, kind, *_):
        if kind is None and self.report is None:
            self.finish()
