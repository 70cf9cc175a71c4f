"""Probes that loops look at themselves: their values are those of numpy, and of their own kernels, to the last bit."""

import dis

import numpy as np
import pytest

from refweb.compiled.rows import records_of
from refweb.effects.base import BLOCK, BLOCK_OUT
from refweb.results import probes


def valued(probe, x, lines):
    where, rows = np.zeros(2, dtype=np.int64), np.array(probe.rows, dtype=np.int64)
    values = [probe.kernel(0.0, x, x, x, lines, rows, probe.data, where)]
    where[1] = probes.PLACE
    probe.kernel(0.0, x, x, x, lines, rows, probe.data, where)
    return values[0], where[0]


@pytest.mark.parametrize("count", [*range(1, 11), 64, 65, 200, 1200])
def test_plain_values(count):
    """Of any number of rows, from any first one on, wherever the largest is; −0 and not a number among them."""
    rng = np.random.default_rng(count)
    for first in (0, 3):
        x, lines = rng.normal(size=(first + count + 2, 3)), rng.normal(size=(first + count + 2, 2))
        x[:first] *= 100.0
        lines[:first] = 100.0
        last = first + count
        data = np.full((count, 1), 0.3)
        node = probes.Probe(probes.displacement, [probes.MAGNITUDE, first, last], np.zeros((count, 3)))
        line = probes.Probe(probes.line, [1, first, last], np.full((last, 1), 0.3))
        kind, scale = probes.plain_of(node)
        assert kind == (probes.NODES, first, last, 0) and scale == 1.0
        value, place = valued(node, x, lines)
        square, near = probes.largest_square(x.ravel(), first, last)
        assert np.sqrt(square) == value and place == first + np.argmax((x[first:last] ** 2).sum(1))
        assert first <= near <= place == probes.row_of_square(x.ravel(), near, last, square)
        np.testing.assert_allclose(value, np.linalg.norm(x[first:last], axis=1).max(), rtol=1e-15)
        kind, scale = probes.plain_of(line)
        assert kind == (probes.LINES, 1, first, last) and scale == 0.3
        value, place = valued(line, x, lines)
        largest, near = probes.largest_in(lines, 1, first, last)
        assert scale * largest == value == (data[:, 0] * lines[first:last, 1]).max()
        assert place == first + np.argmax(lines[first:last, 1])
        assert first <= near <= place == probes.element_of(lines, 1, near, last, scale, value)


@pytest.mark.parametrize("last", range(5, 12))
def test_the_first_of_equal_values_has_the_place(last):
    x, lines = np.zeros((last, 3)), np.zeros((last, 2))
    x[[3, last - 1]], lines[[2, last - 2], 1] = (0.0, 3.0, 4.0), 2.0
    node = probes.Probe(probes.displacement, [probes.MAGNITUDE, 0, last], np.zeros((last, 3)))
    line = probes.Probe(probes.line, [1, 0, last], np.full((last, 1), 0.5))
    assert probes.row_of_square(x.ravel(), 0, last, 25.0) == valued(node, x, lines)[1] == 3
    assert probes.element_of(lines, 1, 0, last, 0.5, 1.0) == valued(line, x, lines)[1] == 2
    assert probes.row_of_square(x.ravel(), 0, last, np.nan) == -1


def test_what_is_not_plain():
    """A component, some rows, places in space, and scales that differ or turn the order round."""
    zero, one = np.zeros((4, 3)), np.ones((4, 1))
    rows = [probes.MAGNITUDE, 0, 4]
    assert probes.plain_of(probes.Probe(probes.displacement, rows, zero))[0][0] == probes.NODES
    others = [
        probes.Probe(probes.displacement, [2, 0, 4], zero),
        probes.Probe(probes.displacement, [probes.MAGNITUDE, -1, -1, 0, 2], zero[:2]),
        probes.Probe(probes.displacement, rows, np.eye(4, 3)),
        probes.Probe(probes.velocity, rows, zero),
        probes.Probe(probes.line, [0, 0, 4], -one),
        probes.Probe(probes.line, [0, 0, 4], np.arange(1.0, 5.0)[:, None]),
        probes.Probe(probes.line_of, [0, 1, 3], one),
    ]
    for probe in others:
        assert probes.plain_of(probe) == ((0, 0, 0, 0), 1.0)


@pytest.mark.parametrize("column", [0, 1])
def test_blocks_have_the_largest_values_and_their_places(column):
    """The first of equal values has the place, also in a later block of which one of them is scaled to the other."""
    rng, count = np.random.default_rng(column), 2 * BLOCK + 30
    lines, top = 0.1 * rng.normal(size=(count, 2)), np.nextafter(3.0, 4.0)
    scale = next(s for s in np.linspace(0.3, 0.9, 100) if s * top == s * 3.0)
    for places in ([700 - BLOCK, 520], [300], [530], [5, 300], [255, 256]):
        values = lines.copy()
        values[places, column] = top
        values[places[0], column] = 3.0
        blocks = np.zeros((4, probes.OF_BLOCKS))
        shows = records_of(BLOCK_OUT, blocks)
        for n, show in enumerate(shows[:3]):
            part = values[n * BLOCK : (n + 1) * BLOCK]
            show["tension"], show["strain"], show["count"] = *part.max(axis=0), len(part)
            show["shown"][: len(part)] = part
            show["shown"][len(part) :] = show["shown"][:1]
        blocks[3, :2] = 99.0  # of steps before
        largest = probes.largest_of_blocks(blocks, column)
        assert largest == values[:, column].max()
        assert probes.element_of_blocks(blocks, column, scale, scale * largest) == places[0]
    assert probes.element_of_blocks(blocks, column, scale, 7.0) == -1


def test_who_reads_each_line():
    """Largest tensions and strains of all lines are those of blocks; nodes and bodies have no lines."""
    rows, one = [probes.MAGNITUDE, 0, 4], np.ones((4, 1))
    largest = probes.Probe(probes.line, [0, 0, 4], one, sign=1.0)
    assert not probes.reads_each_line(largest, 4)
    assert not probes.reads_each_line(largest._replace(rows=[1, 0, 4]), 4)
    for other in (dict(rows=[2, 0, 4]), dict(rows=[0, 1, 4]), dict(sign=-1.0), dict(kernel=probes.slack_fraction)):
        assert probes.reads_each_line(largest._replace(**other), 4)
    assert probes.reads_each_line(largest, 5)
    assert probes.reads_each_line(largest._replace(data=np.arange(1.0, 5.0)[:, None]), 4)
    for kernel in probes.WITHOUT_LINES:
        assert not probes.reads_each_line(probes.Probe(kernel, rows, np.zeros((4, 3)), 1.0), 4)
    assert probes.reads_each_line(probes.Probe(probes.deepest, [0, 4], one, 1.0, term=0), 4)
    for kernel in vars(probes).values():  # a kernel that has the name of lines in its code
        if kernel in probes.WITHOUT_LINES:
            assert "lines" not in kernel.py_func.__code__.co_names
            code = [(i.opname, i.argval) for i in dis.get_instructions(kernel.py_func)]
            assert not any(name.startswith("LOAD_FAST") and value == "lines" for name, value in code)
