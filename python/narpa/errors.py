"""The exceptions of the compiled module."""


class Error(Exception):
    """What narpa refuses, as one sentence: what is wrong and what was expected.

    file: the file that is wrong, or ""; line, column: counted from 1, 0 where they are not known.
    """

    def __init__(self, message, file="", line=0, column=0):
        super().__init__(message)
        self.file, self.line, self.column = file, line, column


class SceneError(Error, ValueError):
    """A scene that cannot be read. file is "--set KEY" for a value of `overrides`."""
