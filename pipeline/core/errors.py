"""The errors of the package: each says what, which value, which rule and what to do."""


class PipelineError(Exception):
    """Base of every error that this package raises on purpose."""


class InputError(PipelineError, ValueError):
    """A value given by the user breaks a rule."""


class BundleError(InputError):
    """A bundle has one or more problems; all of them are listed."""

    def __init__(self, problems: list[str]):
        super().__init__(problems)
        self.problems = tuple(problems)

    def __str__(self) -> str:
        return "\n".join(self.problems)


class MissingFileError(PipelineError, FileNotFoundError):
    """A file that is needed does not exist."""


class StoreError(PipelineError, OSError):
    """A file could not be written, read or trusted."""


class ConvergenceError(PipelineError, RuntimeError):
    """A solver stopped before it reached the accuracy that was asked for."""


class UnavailableError(PipelineError, NotImplementedError):
    """A combination of settings that this version refuses."""


class ToolchainError(PipelineError, RuntimeError):
    """A compiler, a library or a compiled part is missing or does not fit."""


class ProcessLostError(PipelineError, RuntimeError):
    """A process was killed before it had finished its work, through no fault of the work."""
