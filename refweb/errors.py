"""What solvers raise."""


class SolverError(RuntimeError):
    """A solver that found no answer; the message says what, where and when."""
