"""Drag solved for, node by node, where an explicit method kicks velocities.

A kick of size h takes the velocity of a node from v⁻ to v⁺ = v⁻ + h M⁻¹(f + F(u)), f being all other forces and u the
mean of both less the wind: the rule of the midpoint, which loses h F·v, whatever h is. For a node that is

    u = u⁻ + ½h M⁻¹(f + F(u)),

whose solution is unique, since −F is the gradient of a convex function of u. Newton's method finds it from
velocities without drag, or with that of the sweep before. No node feels another's drag, so that one sweep
solves all of them, but for nodes that one body carries, see `refweb.effects.drag.attached_node_drag`.
"""

from __future__ import annotations

import functools

import numpy as np

from ...kernels import COMMIT, DETECT, GAUSS_SEIDEL, WARM_START, kernel
from ..base import CELL, ImplicitContactKernels
from ..line_kernels import direction
from .force import ALONG, GROUP, NORMAL, SLOPES, TANGENTIAL, add_slope, drag_on, relative

ROW, COUNT, COEFFICIENTS, DIRECTION, START, FORCE, WIDTH = 1, 2, 3, 5, 8, 11, 14
"""Columns of what feels drag, behind its cell: its row; how many feel it at this row, at the first of them; c_n and
c_t; t; u⁻; F."""
MOST, CLOSE = 60, 4e-16
"""Steps of Newton's method, and what they leave of the equations, over velocities, at which they end."""


@kernel()
def solve_three(a, b):
    """Solution of a @ y = b for a matrix (3, 3), by Cramer's rule."""
    c0 = a[1, 1] * a[2, 2] - a[1, 2] * a[2, 1]
    c1 = a[1, 2] * a[2, 0] - a[1, 0] * a[2, 2]
    c2 = a[1, 0] * a[2, 1] - a[1, 1] * a[2, 0]
    determinant = a[0, 0] * c0 + a[0, 1] * c1 + a[0, 2] * c2
    y0 = b[0] * c0 + b[1] * (a[0, 2] * a[2, 1] - a[0, 1] * a[2, 2]) + b[2] * (a[0, 1] * a[1, 2] - a[0, 2] * a[1, 1])
    y1 = b[0] * c1 + b[1] * (a[0, 0] * a[2, 2] - a[0, 2] * a[2, 0]) + b[2] * (a[0, 2] * a[1, 0] - a[0, 0] * a[1, 2])
    y2 = b[0] * c2 + b[1] * (a[0, 1] * a[2, 0] - a[0, 0] * a[2, 1]) + b[2] * (a[0, 0] * a[1, 1] - a[0, 1] * a[1, 0])
    return y0 / determinant, y1 / determinant, y2 / determinant


@kernel(forceinline=True)
def speeds_up(touches, n, f, inverse):
    """Acceleration of the row of touch n by forces on all rows."""
    row = int(touches[n, ROW])
    return inverse[row, 0] * f[row, 0], inverse[row, 1] * f[row, 1], inverse[row, 2] * f[row, 2]


@kernel(forceinline=True)
def answer(touches, n, p, inverse):
    """The same by a force p on it."""
    row = int(touches[n, ROW])
    return inverse[row, 0] * p[0], inverse[row, 1] * p[1], inverse[row, 2] * p[2]


@kernel(forceinline=True)
def push(touches, n, p, f):
    """Add a force on it to those on all rows."""
    row = int(touches[n, ROW])
    for k in range(3):
        f[row, k] += p[k]


@functools.cache
def solving(speeds_up, answer, push):
    """Kernel of a sweep over rows whose accelerations and forces three kernels know, as those here."""

    @kernel()
    def settle(h, f, inverse, touches, n, count, matrix, vectors):
        """Find the drag on the row of touch n, of ``count`` touches; the change of its velocity [m/s].

        What it changes by is added to f; ``matrix (3, 3)`` and ``vectors (3, 3)`` are space to work in.
        """
        rest, u, ahead = vectors[0], vectors[1], vectors[2]
        own0 = own1 = own2 = 0.0
        for m in range(n, n + count):
            own0, own1, own2 = own0 + touches[m, FORCE], own1 + touches[m, FORCE + 1], own2 + touches[m, FORCE + 2]
        all_of, response = speeds_up(touches, n, f, inverse), answer(touches, n, (own0, own1, own2), inverse)
        for k in range(3):
            u[k] = touches[n, START + k] + 0.5 * h * all_of[k]
            ahead[k] = u[k] - 0.5 * h * response[k]
        for _ in range(MOST):
            matrix[:] = 0.0
            own0 = own1 = own2 = 0.0
            for m in range(n, n + count):
                t = touches[m, DIRECTION], touches[m, DIRECTION + 1], touches[m, DIRECTION + 2]
                normal, tangential = touches[m, COEFFICIENTS], touches[m, COEFFICIENTS + 1]
                add_slope(t, (u[0], u[1], u[2]), normal, tangential, matrix)
                pull = drag_on(t, (u[0], u[1], u[2]), normal, tangential)
                own0, own1, own2 = own0 + pull[0], own1 + pull[1], own2 + pull[2]
            response, size = answer(touches, n, (own0, own1, own2), inverse), 0.0
            for k in range(3):
                rest[k] = ahead[k] - u[k] + 0.5 * h * response[k]
                size = max(size, abs(u[k]), abs(ahead[k]))
            for j in range(3):
                pull = answer(touches, n, (matrix[0, j], matrix[1, j], matrix[2, j]), inverse)
                for k in range(3):
                    matrix[k, j] = 0.5 * h * pull[k] + (1.0 if k == j else 0.0)
            if not max(abs(rest[0]), abs(rest[1]), abs(rest[2])) > CLOSE * size:
                break
            y = solve_three(matrix, (rest[0], rest[1], rest[2]))
            for k in range(3):
                u[k] += y[k]
        largest = 0.0
        for m in range(n, n + count):
            t = touches[m, DIRECTION], touches[m, DIRECTION + 1], touches[m, DIRECTION + 2]
            response = drag_on(t, (u[0], u[1], u[2]), touches[m, COEFFICIENTS], touches[m, COEFFICIENTS + 1])
            p = (
                response[0] - touches[m, FORCE],
                response[1] - touches[m, FORCE + 1],
                response[2] - touches[m, FORCE + 2],
            )
            change = answer(touches, n, p, inverse)
            push(touches, n, p, f)
            for k in range(3):
                touches[m, FORCE + k] = response[k]
                largest = max(largest, h * abs(change[k]))
        return largest

    @kernel(GAUSS_SEIDEL)
    def sweep(h, number, f, inverse, touches, count):
        """Solve row by row; the largest change of a velocity [m/s]."""
        largest, n, matrix, vectors = 0.0, 0, np.empty((3, 3)), np.empty((3, 3))
        while n < count:
            nodes_here = int(touches[n, COUNT])
            largest = max(largest, settle(h, f, inverse, touches, n, nodes_here, matrix, vectors))
            n += nodes_here
        return largest

    return sweep


@kernel(WARM_START)
def recall(number, memory, f, touches, begin, end):
    """Nothing: one sweep solves drag from anywhere."""


@kernel(COMMIT)
def commit(number, memory, v, touches, begin, end, out):
    """Write the power of each cell at the velocities v."""
    for n in range(begin, end):
        row, power = int(touches[n, ROW]), 0.0
        for k in range(3):
            power += touches[n, FORCE + k] * v[row, k]
        out[int(touches[n, CELL]), 0] = power


@kernel()
def alone(touches, n, x, data, c):
    """Nothing is to be added to what feels drag."""


sweep = solving(speeds_up, answer, push)


@functools.cache
def rubbing(nodes, more=alone, sweep=sweep, width=WIDTH):
    """The `ImplicitContactKernels` of cells of so many nodes, where those of a row stand together.

    Parameters
    ----------
    nodes : int
        Their number.
    more : kernel
        Sees each row of what feels drag; it has the arguments of `alone`.
    sweep : kernel
        A sweep.
    width : int
        Number of columns of what feels drag.
    """

    @kernel(DETECT)
    def detect(h, x, v, inverse, cells, data, touches, begin):
        for c in range(cells.shape[0] if begin + cells.shape[0] <= touches.shape[0] else 0):
            n, (t, _) = begin + c, direction(x, cells, data, c, nodes, ALONG, SLOPES)
            u = relative(v, cells, data, c)
            touches[n, CELL], touches[n, ROW], touches[n, COUNT] = c, cells[c, 0], data[c, GROUP]
            touches[n, COEFFICIENTS], touches[n, COEFFICIENTS + 1] = data[c, NORMAL], data[c, TANGENTIAL]
            for k in range(3):
                touches[n, DIRECTION + k], touches[n, START + k], touches[n, FORCE + k] = t[k], u[k], 0.0
            more(touches, n, x, data, c)
        return begin + cells.shape[0]

    return ImplicitContactKernels(detect, recall, sweep, commit, width, 0, more is not alone)
