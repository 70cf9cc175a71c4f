"""What refweb refuses, and what solvers raise."""


class InputError(ValueError):
    """Input that refweb refuses; the message is one line with the value, the limit and the remedy."""

    def __init__(self, message):
        super().__init__(one_line(message))


def one_line(text):
    """A text without line breaks and control characters."""
    text = " ".join(str(text).split())
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)


class SolverError(RuntimeError):
    """A solver that found no answer; the message says what, where and when."""


class OpenBook(SolverError):
    """The energy of a run drifted away from the work done on it."""
