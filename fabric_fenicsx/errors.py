"""The ways a run ends badly, each with the exit code that the command line returns."""


class InputError(Exception):
    """Bad input: one line that names the file, the key and what is allowed. Exit code 2."""

    exit_code = 2


class SolveError(Exception):
    """A solve that could not go on, where and why; accepted steps stay on disk. Exit code 1."""

    exit_code = 1


class FitError(SolveError):
    """The baseline model could not be fitted to measurements. Exit code 3."""

    exit_code = 3
