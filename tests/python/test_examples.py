"""The example programs and the notebook that use the compiled module."""
import importlib.util
import json
import os
import re
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

import needs

needs.compiled()
needs.modules("matplotlib")

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"


def output_of(name, *arguments):
    done = subprocess.run([sys.executable, EXAMPLES / name, *map(str, arguments)], capture_output=True, text=True)
    if done.returncode != 0:
        raise AssertionError(done.stdout + done.stderr)
    return done.stdout


class Programs(unittest.TestCase):
    def test_exposure_sweep_finds_an_exposure(self):
        rows = [line.split() for line in output_of("exposure_sweep.py").splitlines()]
        means = [float(row[1]) for row in rows if len(row) == 4 and row[3].endswith("%")]
        self.assertEqual(len(means), 7)
        self.assertEqual(means, sorted(means), "longer exposures are brighter")
        self.assertRegex(" ".join(rows[-1]), r"longest exposure .*: \d\.\d+ ms")

    def test_errors_are_near_the_bound(self):
        output = output_of("error_against_bound.py", 3)
        ratios = [float(r) for r in re.findall(r"ratio (\d+\.\d+)", output)]
        self.assertEqual(len(ratios), 2, output)
        for ratio in ratios:
            self.assertTrue(0.1 < ratio < 10, output)


class Notebook(unittest.TestCase):
    def test_all_cells_run(self):
        notebook = EXAMPLES / "narpa.ipynb"
        if importlib.util.find_spec("nbconvert") and importlib.util.find_spec("ipykernel"):
            with tempfile.TemporaryDirectory() as folder:
                command = [sys.executable, "-m", "nbconvert", "--to", "notebook", "--execute", "--ExecutePreprocessor.timeout=1800",
                           "--output-dir", folder, notebook]  # fmt: skip
                environment = {**os.environ, "HOME": folder, "JUPYTER_PREFER_ENV_PATH": "0"}
                done = subprocess.run(command, capture_output=True, text=True, env=environment)
                self.assertEqual(done.returncode, 0, done.stderr[-3000:])
                cells = json.loads((Path(folder) / "narpa.ipynb").read_text())["cells"]
                said = "".join(text for cell in cells for out in cell.get("outputs", []) for text in out.get("text", []))
        else:  # the cells as one program
            cells = [cell for cell in json.loads(notebook.read_text())["cells"] if cell["cell_type"] == "code"]
            program = "import matplotlib\nmatplotlib.use('Agg')\n" + "\n".join("".join(cell["source"]) for cell in cells)
            said = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True).stdout
        self.assertRegex(said, r"\d+ shots, \d+ returns")
        self.assertRegex(said, r"good|unobservable")


if __name__ == "__main__":
    unittest.main()
