"""Laws of controls: from an error and its rate to the value that is set, component by component.

A law has ``reset()``, ``act(measurement, time)``, and for runs that go on ``save()`` and ``restore(numbers)``.

May change: how a law computes its value. Must stay: fields of laws, which are parameters in scenes; keys of `LAWS`,
names in scenes; fields of `Measurement`, which laws of users read; numbers of `save`, which stand in checkpoints. A law
of one's own needs no entry in `LAWS`. Tests: ``tests/dynamics/test_control.py``.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray


class Measurement(NamedTuple):
    """A measurement of a control.

    Attributes
    ----------
    value, rate : ndarray, shape (measures,)
        Measured value, and its rate.
    target, target_rate : ndarray, shape (measures,)
        Its target, and the rate of that.
    period : float
        Time until the next measurement [s].
    limited : bool
        True if the value before was above the limit.
    """

    value: NDArray[np.float64]
    rate: NDArray[np.float64]
    target: NDArray[np.float64]
    target_rate: NDArray[np.float64]
    period: float
    limited: bool

    @property
    def error(self) -> NDArray[np.float64]:
        """Target less value."""
        return self.target - self.value

    @property
    def error_rate(self) -> NDArray[np.float64]:
        """Rate of the error."""
        return self.target_rate - self.rate


class Law:
    """A law without a state."""

    def reset(self) -> None:
        """Begin a run."""

    def save(self) -> list[float]:
        """The state as numbers."""
        return []

    def restore(self, numbers: Sequence[float]) -> None:
        """Take a saved state."""


@dataclass
class Pid(Law):
    """Proportional, integral and derivative feedback; the integral waits while the limit acts."""

    proportional: float = 0.0
    integral: float = 0.0
    derivative: float = 0.0

    def reset(self) -> None:
        """Begin with an integral of zero."""
        self._sum: NDArray[np.float64] = np.zeros(1)

    def act(self, measurement: Measurement, time: float) -> NDArray[np.float64]:
        """The value; the integral has the periods before."""
        error = measurement.error
        value = self.proportional * error + self.integral * self._sum + self.derivative * measurement.error_rate
        if not measurement.limited:
            self._sum = self._sum + measurement.period * error
        return value

    def save(self) -> list[float]:
        """The integral."""
        return self._sum.tolist()

    def restore(self, numbers: Sequence[float]) -> None:
        """Take an integral."""
        self._sum = np.array(numbers)


def _positive(law, *names):
    """Refuse parameters of a law that are not above zero."""
    for name in names:
        if not getattr(law, name) > 0.0:
            raise ValueError(f"{name} = {getattr(law, name):g} must be > 0")


@dataclass
class SlidingMode(Law):
    """Feedback of one size that leads to the surface e' + slope · e = 0, smooth within ``width`` of it."""

    strength: float
    slope: float
    width: float

    def __post_init__(self) -> None:
        _positive(self, "strength", "width")

    def act(self, measurement: Measurement, time: float) -> NDArray[np.float64]:
        """The value."""
        surface = measurement.error_rate + self.slope * measurement.error
        return self.strength * np.clip(surface / self.width, -1.0, 1.0)


@dataclass
class BangBang(Law):
    """Feedback of one size that brings a mass to its target in least time."""

    strength: float
    mass: float

    def __post_init__(self) -> None:
        _positive(self, "strength", "mass")

    def surface(self, measurement: Measurement) -> NDArray[np.float64]:
        """The number whose sign decides."""
        rate = measurement.error_rate
        return measurement.error + rate * np.abs(rate) * self.mass / (2.0 * self.strength)

    def act(self, measurement: Measurement, time: float) -> NDArray[np.float64]:
        """The value; on the switching curve that of the motion along it."""
        side = self.surface(measurement)
        return self.strength * np.where(side == 0.0, np.sign(measurement.error_rate), np.sign(side))


@dataclass
class SpinUp(Law):
    """Torque of a hub that falls linearly to zero at the target speed."""

    strength: float

    def act(self, measurement: Measurement, time: float) -> NDArray[np.float64]:
        """The value."""
        if not measurement.target.all():
            raise ValueError("the target is 0, and must not be: it is the speed that is led to")
        return self.strength * (1.0 - measurement.value / measurement.target)


@dataclass
class StationKeeping(Law):
    """Proportional and derivative feedback outside of a dead band about the target."""

    proportional: float
    derivative: float
    dead_band: float

    def act(self, measurement: Measurement, time: float) -> NDArray[np.float64]:
        """The value."""
        error = measurement.error
        value = self.proportional * error + self.derivative * measurement.error_rate
        return value if np.linalg.norm(error) > self.dead_band else 0.0 * value


LAWS = {
    "pid": Pid,
    "sliding-mode": SlidingMode,
    "bang-bang": BangBang,
    "spin-up": SpinUp,
    "station-keeping": StationKeeping,
}
"""Laws by name."""
