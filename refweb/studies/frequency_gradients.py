"""Gradients of natural frequencies, with ±: through K and M, and through the equilibrium about which a web vibrates.

With the shape φ of a mode and L = K + iωG − ω²M, at rest K − λM, Lφ = 0 has the derivative

    df = φ*(∂L/∂p + ∂L/∂x · dx/dp) φ,        φ*Nφ = 1,        N = 2π (2ωM − iG),        at rest 4π √|λ| M,

where φ is fixed: a change of the shape changes φ*Lφ to second order alone. This form is a function of displacement and
numbers as any result of statics, and dx/dp follows from its adjoint, see `refweb.statics.adjoint`. φ*(∂K/∂x)φ is exact
of lines. Of other effects it is the derivative of Kφ along φ, the third derivative of their potential, by differences;
of rotations of bodies it is that of the form itself.

Frequencies that are equal within ± have the shapes Φ, of which any mixture is a shape. For a number that rises they
change by the eigenvalues of Φ*(dL/dp)Φ in their order, for one that falls in the reverse order [1]_. The entries of
this matrix are forms of φ_i and of (φ_i + φ_j)/√2, in axes that turn of (φ_i + iφ_j)/√2 as well.

± holds besides the errors of the equilibrium those of the shapes, by their residuals and by rounding. A change of L
bends a shape by δφ with L δφ = −(δL) φ, where as many components as there are equal frequencies stay [2]_.

May change: private functions; `STEPS`, `FIRST`, `SHRINKS` and `ENOUGH`, by which differences are made; `MOST`,
`ROUNDED` and `OPPOSED`, limits of what has a gradient. Must stay: `FrequencyGradients`, which `modes` calls, and
`NAME`, by which `commands.gradient` knows a frequency; names of results, which are those of `modes`; ± that covers the
error. Tests: ``tests/studies/test_frequency_gradients.py``.

References
----------
.. [1] A. P. Seyranian, E. Lund, N. Olhoff, "Multiple eigenvalues in structural optimization problems", Structural
   Optimization 8 (1994) 207–227, doi:10.1007/BF01742705.
.. [2] R. B. Nelson, "Simplified calculation of eigenvector derivatives", AIAA Journal 14 (1976) 1201–1205,
   doi:10.2514/3.7211.
"""

from __future__ import annotations

import re
from typing import Any, NamedTuple
from weakref import WeakKeyDictionary

import numpy as np
import scipy.linalg
from scipy.sparse import csc_matrix
from scipy.sparse.linalg import splu

from ..effects.base import refuse_flows
from ..errors import InputError
from ..messages import nearest, short
from ..statics.adjoint import MASSES, Sensitivity
from ..statics.gradients import MOVED, SHARES, Gradients
from ..statics.responses import Response
from .spectrum import spectrum
from .turning import coriolis

NAME = re.compile(r"frequency_([1-9][0-9]*)")
"""Names of natural frequencies."""
MOST = 8
"""Largest number of frequencies that may be equal."""
STEPS, FIRST, SHRINKS, ENOUGH = 6, 1e-2, 8.0, 1e-11
"""Number of steps of differences, the first over lengths, their ratio, and the relative error that is small enough."""
ROUNDED = 1e-14
"""Slope of a form over the size of its terms that is rounding."""
OPPOSED = 1e-6
"""φ*Nφ over 4πω φ*Mφ below which a frequency in axes that turn is about to meet one of the other sign."""


class Forms:
    """L and N of a system at a displacement.

    Parameters
    ----------
    system : refweb.system.system.System
        The system that vibrates.
    t : float
        Load step.
    x : ndarray, shape (rows, 3)
        Displacement [m].
    """

    def __init__(self, system, t, x):
        self.K = system.pattern.matrix(system.stiffness(t, x))
        self.M = system.pattern.matrix(system.mass_at(x))
        self.G = coriolis(system, x)

    def matrix(self, squared):
        """L at ω² [N/m]."""
        at_rest = self.K - squared * self.M
        return at_rest if self.G is None else at_rest + 1j * np.sqrt(squared) * self.G

    def normal(self, squared):
        """N at ω² [kg/s]."""
        at_rest = 4.0 * np.pi * np.sqrt(abs(squared)) * self.M
        return at_rest if self.G is None else at_rest - 2j * np.pi * self.G


class Mode(NamedTuple):
    """ω² [1/s²], and a shape of the unknowns of which φ*Nφ is the ``sign``."""

    squared: float
    shape: np.ndarray
    sign: float


class Equal:
    """Shapes of one natural frequency, or of several that are equal within ±.

    Parameters
    ----------
    linear : refweb.statics.adjoint.Adjoint
        The equilibrium.
    squared : float
        ω² [1/s²].
    shapes : ndarray, shape (unknowns, m)
        The shapes, real or complex.

    Raises
    ------
    InputError
        Where frequencies in axes that turn meet one of the other sign.
    """

    def __init__(self, linear, squared, shapes):
        self._linear, self.squared, self._forms = linear, squared, WeakKeyDictionary()
        forms = self.forms(linear.state)
        product = shapes.conj().T @ (forms.normal(squared) @ shapes)
        sizes, mixed = np.linalg.eigh(product)
        weight = 4.0 * np.pi * np.sqrt(abs(squared)) * (shapes.conj() * (forms.M @ shapes)).sum(axis=0).real.min()
        if sizes[0] * sizes[-1] <= 0.0 or np.abs(sizes).min() < OPPOSED * weight:
            raise InputError("Coriolis forces let two frequencies meet there, which has no derivative")
        self.sign, self.shapes = float(np.sign(sizes[0])), shapes @ (mixed / np.sqrt(np.abs(sizes))) @ mixed.conj().T
        kind = complex if linear.system.rotating else float
        self._matrix, self._normal = forms.matrix(squared).astype(kind), forms.normal(squared) @ self.shapes
        count = self.shapes.shape[1]
        fixed = scipy.linalg.qr(self.shapes.conj().T, mode="r", pivoting=True)[1][:count]
        self._bent = np.setdiff1d(np.arange(len(self.shapes)), fixed)
        self._lu = splu(csc_matrix(self._matrix[self._bent][:, self._bent])) if len(self._bent) else None

    def forms(self, state):
        """The `Forms` of a `refweb.results.state.State`."""
        if state not in self._forms:
            self._forms[state] = Forms(state.system, state.time, state.x)
        return self._forms[state]

    def modes(self):
        """The `Mode` of each shape, and of mixtures of each pair of them."""
        shapes, count = self.shapes.T, self.shapes.shape[1]
        mixed = [shapes[i] + shapes[j] for i in range(count) for j in range(i)]
        if self._linear.system.rotating:
            mixed += [shapes[i] + 1j * shapes[j] for i in range(count) for j in range(i)]
        return [Mode(self.squared, shape, self.sign) for shape in (*shapes, *(m / np.sqrt(2.0) for m in mixed))]

    def change(self, rest):
        """Change δφ of a shape with L δφ = −``rest``, without parts along the shapes of this frequency."""
        bent = np.zeros(len(self.shapes), dtype=np.result_type(rest, self._matrix))
        if self._lu is not None:
            bent[self._bent] = -self._lu.solve(rest[self._bent].astype(self._matrix.dtype))
        return bent - self.sign * self.shapes @ (self._normal.conj().T @ bent)

    def moved(self, mode, linear):
        """A `Mode` at another `refweb.statics.adjoint.Adjoint`, to first order."""
        forms = self.forms(linear.state)
        rest = forms.matrix(mode.squared) @ mode.shape - self._matrix @ mode.shape
        shift = 2.0 * np.pi * mode.sign * np.vdot(mode.shape, rest).real
        omega = np.sqrt(abs(mode.squared)) + shift * (1.0 if mode.squared > 0.0 else -1.0)
        squared = np.sign(mode.squared) * omega**2
        shape = mode.shape + self.change(rest)
        return mode._replace(squared=squared, shape=shape / _size(forms, squared, shape))

    def disturbed(self, mode):
        """Pairs of a `Mode` with an enlarged error and the factor to its error: by its residual and by rounding."""
        forms, signs = self.forms(self._linear.state), np.random.default_rng(0).choice((-1.0, 1.0), len(mode.shape))
        size = np.abs(mode.shape)
        rounding = abs(forms.K) @ size + abs(mode.squared) * (abs(forms.M) @ size)
        for factor, rest in zip(
            SHARES, (self._matrix @ mode.shape, 8.0 * np.finfo(float).eps * signs * rounding), strict=True
        ):
            change = self.change(rest)
            share = np.abs(change).max() / (MOVED * size.max())
            if share > 0.0:
                shape = mode.shape + change / share
                yield mode._replace(shape=shape / _size(forms, mode.squared, shape)), factor * share


def _size(forms, squared, shape):
    """√|φ*Nφ| of a shape."""
    return np.sqrt(abs(np.vdot(shape, forms.normal(squared) @ shape).real))


class FrequencyGradients(Gradients):
    """Gradients of the results of `refweb.modes`, its natural frequencies among them.

    Parameters
    ----------
    modes : refweb.studies.modes.Modes
        The modes.
    """

    of_modes = True

    def __init__(self, modes):
        super().__init__(modes)
        self._spectrum, self._seed, self._groups = modes.spectra[-1], modes.scene.seed, {}

    def _refuse_unknown(self, result):
        if NAME.fullmatch(result) is not None:
            refuse_flows(self.state.system.net, f"a gradient of {result}")
        elif result not in self._observed:
            names = [*self._observed, *(f"frequency_{n}" for n in range(1, len(self._spectrum.squared) + 1))]
            raise InputError(f'result "{short(result)}" is none of these modes, {nearest(result, names)}')

    def _responses(self, result):
        if NAME.fullmatch(result) is None:
            return super()._responses(result)
        if self._yielded:
            raise InputError("lines have yielded, whose vibrations depend on the path: it is not taken")
        first, last = self._equal_to(result)
        modes, linear = self._spectrum, self.linear
        squared = modes.squared[first:last]
        if len(squared) > MOST:
            raise InputError(f"{len(squared)} frequencies are equal within ±, of which up to {MOST} are taken")
        if (np.abs(squared) <= modes.bound[first:last]).any():
            raise InputError("it is 0 within ±, where a frequency has a kink")
        if squared[0] < 0.0 and coriolis(linear.system, linear.x) is not None:
            raise InputError("it is a mode that grows in axes that turn, whose rate has no gradient here")
        shapes = modes.shapes[first:last] - 1j * (0.0 if modes.later is None else modes.later[first:last])
        shapes = shapes.reshape(last - first, -1)[:, linear.system.free].T
        equal = Equal(linear, float(squared.mean()), shapes if modes.later is not None else shapes.real)
        responses = []
        for mode in equal.modes():
            for rows in _parts(linear, mode.shape):
                self._refuse_kinks(np.linalg.norm(linear.net.bars @ rows, axis=1).reshape(len(linear.net.cells), -1))
            beside = tuple((_form(equal, off, linear), share) for off, share in equal.disturbed(mode))
            responses.append(_form(equal, mode, linear)._replace(beside=beside))
        return responses

    def _equal_to(self, result):
        """Numbers of the first and of the one behind the last mode whose frequency is that of a result within ±."""
        match: Any = NAME.fullmatch(result)
        number, linear, more, complete = int(match[1]), self.linear, 1, False
        while number not in self._groups:
            known, count = self._spectrum, len(self._spectrum.frequency)
            apart = np.diff(known.frequency) > known.error[1:] + known.error[:-1]
            ends = np.array([0, *(np.flatnonzero(apart) + 1), count])
            last = int(ends[min(np.searchsorted(ends, number - 1, side="right"), len(ends) - 1)])
            if number <= count and (complete or last < count):
                self._groups[number] = int(ends[ends < number].max()), last
            elif complete:
                raise InputError(f"there are {count} modes")
            else:
                wanted, more = max(number, count) + more, 3 * more
                self._spectrum = spectrum(linear.system, linear.t, linear.x, wanted, self._seed)
                complete = len(self._spectrum.frequency) < wanted
        return self._groups[number]

    def _by_node(self, solved, path):
        if path == "position" and self.linear.system.angles and solved[0][1].size:
            raise InputError(
                "frequencies take no position of supports beside bodies that turn: move a point of the web"
            )
        return super()._by_node(solved, path)

    def _refuse_by_line(self, path):
        super()._refuse_by_line(path)
        if path != "cable.modulus" and self.linear.system.carried.any():
            raise InputError("by line and group mass beside [[attach]] is not taken: name one number of the scene")

    def _sides(self, result, every, errors):
        if (match := NAME.fullmatch(result)) is None:
            return super()._sides(result, every, errors)
        first, last = self._equal_to(result)
        at, count = int(match[1]) - 1 - first, last - first
        matrix = np.zeros((*every.shape[1:], count, count), dtype=complex)
        error = np.zeros(matrix.shape)
        for i in range(count):
            matrix[..., i, i], error[..., i, i] = every[i], errors[i]
        pairs = [(i, j) for i in range(count) for j in range(i)]
        for number, (i, j) in enumerate(pairs * 2 if len(every) > count + len(pairs) else pairs):
            off = every[count + number] - 0.5 * (every[i] + every[j])
            part = off if number < len(pairs) else 1j * off  # φ_j*(dL)φ_i; of φ_i + iφ_j its imaginary part
            matrix[..., i, j] += part
            matrix[..., j, i] += np.conj(part)
            error[..., i, j] += errors[count + number] + 0.5 * (errors[i] + errors[j])
            error[..., j, i] = error[..., i, j]
        sorted_ = np.linalg.eigvalsh(matrix)
        return sorted_[..., at], sorted_[..., count - 1 - at], error.sum(axis=-1).max(axis=-1)

    def _unit(self, result):
        return "Hz" if NAME.fullmatch(result) else super()._unit(result)

    def _equal(self, result):
        if NAME.fullmatch(result) is None:
            return super()._equal(result)
        first, last = self._equal_to(result)
        return tuple(f"frequency_{n + 1}" for n in range(first, last)) if last - first > 1 else ()


def _parts(linear, shape):
    """Displacements of all rows by the real and the imaginary part of a shape, a list of (rows, 3)."""
    parts = [shape.real, shape.imag] if np.iscomplexobj(shape) else [shape]
    return [linear.rows_of(part) for part in parts]


def _form(equal, mode, linear):
    """The `Response` of φ*Lφ of a mode, with its shape and ω² fixed."""
    parts, system = _parts(linear, mode.shape), linear.system
    explicit = _explicit(mode, parts, linear)
    if system.angles:
        slope, doubt = _slope_of_unknowns(mode, linear)
    else:
        slope, doubt = _slope_of_rows(parts, linear)

    def value(state):
        forms = equal.forms(state)
        return mode.sign * np.vdot(mode.shape, forms.matrix(mode.squared) @ mode.shape).real

    size, forms = np.abs(mode.shape), equal.forms(linear.state)
    return Response(
        again=lambda near: _form(equal, equal.moved(mode, near), near),
        value=value,
        slope=mode.sign * slope,
        explicit=Sensitivity.zeros(linear.net).plus(explicit, mode.sign),
        reacting=np.zeros_like(slope),
        doubt=doubt if doubt.any() else None,
        size=float(size @ (abs(forms.K) @ size) + abs(mode.squared) * (size @ (abs(forms.M) @ size))),
    )


def _explicit(mode, parts, linear):
    """∂(φ*Lφ)/∂p by numbers of elements and rows at rest, a `refweb.statics.adjoint.Sensitivity`."""
    net, system, total = linear.net, linear.system, Sensitivity.zeros(linear.net)
    for rows in parts:
        bars = _Bars(linear, rows)
        total.axial[:] += bars.by_ea()
        total.length[:] += bars.by_length()
        total.mass[:] -= mode.squared * (rows**2).sum(axis=1)
        for term in (term for term in linear.weight if term.tangent.stiffness is not None):
            pushed = _pushed(term, linear, linear.x, rows)
            total.mass[:] += (pushed * rows).sum(axis=1)
        if net.consistent_minus_lumped is not None:
            total.coupled[:] -= mode.squared * _coupled(net, rows, rows)
        if system.carriers and system.carried.any():
            arms = np.zeros_like(rows)
            for node, body in system.carriers.turns.carried.tolist():
                row, spin, _ = system.carriers.turns.rows[body]
                arms[node] = np.cross(rows[spin], rows[node] - rows[row])  # by which it moves to second order
            total.axial[:] -= linear.lines.work(arms)[0]
    if len(parts) == 2 and system.rotating:
        speed, omega = np.array(system.rotating[0].frame.angular_velocity), np.sqrt(mode.squared)
        turned = np.cross(speed, parts[0])
        total.mass[:] += 4.0 * omega * (parts[1] * turned).sum(axis=1)
        if net.consistent_minus_lumped is not None:
            total.coupled[:] += 4.0 * omega * _coupled(net, parts[1], turned)
    return total


def _coupled(net, left, right):
    """Form of consistent less lumped mass of each element over its mass, shape (cells,)."""
    products = np.einsum("cai,cab,cbi->c", left[net.cells], net.consistent_minus_lumped, right[net.cells])
    return products / np.where(net.element_mass > 0.0, net.element_mass, 1.0)


class _Bars:
    """Stiffness of the bars of a net in a displacement of all rows, and its derivatives.

    A bar of the length l with the direction t, the tension T and the slope T' over strain has the form (T'/L) a² +
    (T/l) (b·b − a²) of the difference b of the displacements of its ends, with a = t·b.
    """

    def __init__(self, linear, rows):
        net, lines = linear.net, linear.lines
        self.net, self.lines, self.rows = net, lines, rows
        self.length, self.stretched = net.bar_lengths, np.linalg.norm(net.bar_vectors(linear.x), axis=1)
        self.stretched[self.stretched == 0.0] = 1.0
        self.tension, self.tangent, self.curvature = (
            values.ravel() for values in (lines.tension, lines.tangent, lines.curvature)
        )
        moved = net.bars @ rows
        self.along = (moved * lines.direction).sum(axis=1)
        self.across = moved - self.along[:, None] * lines.direction
        self.turned = (self.across**2).sum(axis=1)

    def _of_cells(self, values):
        """Sums over the bars of each cell."""
        return values.reshape(len(self.net.cells), -1).sum(axis=1)

    def by_ea(self):
        """Derivatives by EA of each element [N]."""
        ea = self.net.line_data.ea
        form = self.tangent / self.length * self.along**2 + self.tension / self.stretched * self.turned
        return self._of_cells(form) / np.where(ea != 0.0, ea, 1.0)

    def by_length(self):
        """Derivatives by the natural length of each element [m]."""
        strained = self.curvature * (1.0 + self.lines.strain.ravel()) + self.tangent
        form = strained * self.along**2 + self.tangent * self.turned
        weights = np.tile(self.net.weights, len(self.net.cells))
        return -self._of_cells(weights * form / self.length**2)

    def slope(self):
        """Derivatives by the displacement of all rows, shape (rows, 3), with 0 in place of rounding."""
        natural, hold = self.length, self.tension / self.stretched
        excess = (self.tangent / natural - hold) / self.stretched
        along = self.curvature / natural**2 * self.along**2 + excess * self.turned
        across = 2.0 * excess * self.along
        slope = self.net.bars.T @ (along[:, None] * self.lines.direction + across[:, None] * self.across)
        size = np.abs(self.curvature) / natural**2 + (self.tangent / natural + np.abs(hold)) / self.stretched
        size = abs(self.net.bars).T @ (size * (self.along**2 + self.turned))
        return np.where(np.abs(slope) > ROUNDED * size[:, None], slope, 0.0)


def _pushed(term, linear, x, rows):
    """Stiffness of a term at a displacement x times a displacement of all rows, shape (rows, 3)."""
    size = 3 * term.cells.shape[1]
    blocks, total = np.empty((len(term.cells), size, size)), np.zeros_like(rows)
    data = linear.system.data_of(term, linear.t)
    term.tangent.stiffness(linear.t, x, np.zeros_like(rows), blocks, term.cells, data, False)
    pushed = np.einsum("cij,cj->ci", blocks, rows[term.cells].reshape(len(term.cells), -1))
    np.add.at(total, term.cells, pushed.reshape(*term.cells.shape, 3))
    return total


def _slope_of_rows(parts, linear):
    """(∂(φ*Kφ)/∂x, its possible error), of nodes and bodies that do not turn."""
    slope, doubt = np.zeros_like(linear.x), np.zeros_like(linear.x)
    others = [
        term
        for term in linear.system.terms
        if term.tangent.stiffness is not None and not term.over_lines and term.name not in MASSES
    ]
    for rows in parts:
        slope += _Bars(linear, rows).slope()
        largest = np.abs(rows).max()
        if not (others and largest):
            continue

        def stiff(step, rows=rows):
            return sum(_pushed(term, linear, linear.x + step * rows, rows) for term in others)

        value, error = _derivative(stiff, linear.net.natural_length.min() / largest)
        slope, doubt = slope + value, doubt + error
    return slope, doubt


def _slope_of_unknowns(mode, linear):
    """Solve as `_slope_of_rows`, where bodies turn: by unknowns, of rotations the derivative of the whole form."""
    system, t, x = linear.system, linear.t, linear.x
    size, levers = float(linear.net.natural_length.min()), np.repeat(system.levers, 3)[system.free]
    slope, doubt = np.zeros(len(system.free)), np.zeros(len(system.free))
    for part in (mode.shape.real, mode.shape.imag) if np.iscomplexobj(mode.shape) else (mode.shape,):
        if not (largest := np.abs(levers * part).max()):
            continue

        def stiff(step, part=part):
            moved = system.moved(x, system.rows_of(step * part))
            system.drive(t, moved)
            return system.pattern.matrix(system.stiffness(t, moved)) @ part

        value, error = _derivative(stiff, size / largest)
        slope, doubt = slope + value, doubt + error
    spins = [body.spin for body in system.resting if body.spin is not None]
    for unknown in np.flatnonzero(np.isin(system.free // 3, spins)):

        def form(angle, unknown=unknown):
            moved = system.moved(x, system.rows_of(angle * (np.arange(len(slope)) == unknown)))
            system.drive(t, moved)
            matrix = Forms(system, t, moved).matrix(mode.squared)
            return np.vdot(mode.shape, matrix @ mode.shape).real

        slope[unknown], doubt[unknown] = _derivative(form, min(size / levers[unknown], 1.0))
    return system.rows_of(slope), system.rows_of(doubt)


def _derivative(function, size):
    """(Derivative at 0, its possible error) of a function of a number, by differences of order 4 of the best step."""
    best: Any = None
    before = None
    for attempt in range(STEPS):
        step = FIRST * size / SHRINKS**attempt
        values = [function(k * step) for k in (-2.0, -1.0, 1.0, 2.0)]
        near = (values[2] - values[1]) / (2.0 * step)
        value = (4.0 * near - (values[3] - values[0]) / (4.0 * step)) / 3.0
        error = np.abs(value - (near if before is None else before))
        if np.any(error):
            error = error + 4.0 * np.finfo(float).eps * np.abs(values[1]) / step
        before = value
        if best is None or np.max(error) < np.max(best[1]):
            best = value, error
        if np.max(error) <= ENOUGH * np.max(np.abs(value)):
            break
    return best
