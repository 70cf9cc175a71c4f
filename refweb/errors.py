"""What solvers raise."""


class SolverError(RuntimeError):
    """A solver that found no answer; the message says what, where and when."""


class OpenBook(SolverError):
    """The energy of a run drifted away from the work done on it."""
