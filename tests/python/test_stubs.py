"""narpa/__init__.pyi names what the compiled module has, and every public name has a docstring."""
import ast
import os
import subprocess
import sys
import unittest
from pathlib import Path

import needs

needs.compiled()

import narpa
import narpa.toml

STUB = ast.parse((Path(narpa.__file__).resolve().parent / "__init__.pyi").read_text())


def public_of(kind):
    return {name for name in dir(kind) if not name.startswith("_")}


class Stubs(unittest.TestCase):
    def test_classes_have_the_members_of_their_stubs(self):
        stubs = {node.name: node for node in STUB.body if isinstance(node, ast.ClassDef)}
        for name in ("Scene", "Frame", "CameraInfo", "Emulator", "EmulatedFrame", "EmulatedSweep", "Step"):
            members = {m.name for m in stubs[name].body if isinstance(m, ast.FunctionDef) and not m.name.startswith("_")}
            members -= {"report"}
            self.assertEqual(public_of(getattr(narpa, name)) - {"report"}, members, name)

    def test_every_public_name_is_there(self):
        stubbed = {node.name for node in STUB.body if isinstance(node, (ast.ClassDef, ast.FunctionDef))}
        stubbed |= {alias.asname for node in STUB.body if isinstance(node, ast.ImportFrom) for alias in node.names if alias.asname}
        self.assertEqual(set(narpa.__all__), stubbed)
        for name in narpa.__all__:
            self.assertTrue(getattr(narpa, name).__doc__, name)

    def test_functions_have_the_parameters_of_their_stubs(self):
        for node in STUB.body:
            if isinstance(node, ast.FunctionDef):
                code = getattr(narpa, node.name).__code__
                parameters = [a.arg for a in (*node.args.args, *node.args.kwonlyargs)]
                self.assertEqual(list(code.co_varnames[:code.co_argcount + code.co_kwonlyargcount]), parameters, node.name)

    def test_docstrings_say_what_methods_take(self):
        for kind in (narpa.Scene, narpa.Emulator):
            for name in public_of(kind) - {"load", "parse", "name", "file", "report"}:
                self.assertTrue(getattr(kind, name).__doc__, f"{kind.__name__}.{name}")


class WithoutTheModule(unittest.TestCase):
    def test_the_pure_part_works_and_the_rest_says_what_is_missing(self):
        package = Path(narpa.__file__).resolve().parents[1]  # the sources
        program = "import narpa, narpa.rotation\ntry:\n    narpa.load_scene\nexcept ImportError as error:\n    print(error)"
        environment = {**os.environ, "PYTHONPATH": str(package)}
        done = subprocess.run([sys.executable, "-c", program], env=environment, capture_output=True, text=True)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertRegex(done.stdout, "PYTHONPATH to build/release/python .*pybind11-dev")


if __name__ == "__main__":
    unittest.main()
