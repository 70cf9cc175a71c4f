"""Doubts about a scene that nothing forbids: units, places and directions that are seldom meant; `refweb check` alone.

A scene is refused where it cannot be, and a run warns of what limits its results. Here is what lies between: a modulus
in MPa, an area in mm², a body that never meets the web. Nothing is solved for it.
"""

# May change: all limits and texts, as `commands.check` alone prints these findings. Must stay: codes of findings, which
# stand in `refweb.findings.CODES`; `doubts_on`, which `check` calls; that nothing is solved; `_largest_area`, which a
# test calls. Tests: tests/commands/test_doubts.py, which has a scene and its neighbour for each doubt.

from __future__ import annotations

import numpy as np

from ..findings import Finding
from ..results.units import readable

SOFTEST = 1e5
"""Modulus below that of rubber and foams [Pa]."""
LARGEST_CELL = 1e3
"""Area of a mesh above which lengths may be in another unit [m²]."""
FLAT = 1e-6
"""Thickness of a flat web over its size."""
TIMES, PAIRS = 200, 20_000_000
"""Number of times at which a straight path is looked at, and largest number of distances that are computed."""


def doubts_on(scene, system):
    """Yield findings on what is seldom meant in a `refweb.Scene`, whose system is given as well."""
    yield from _on_modulus(scene, system)
    yield from _on_cells(scene, system)
    yield from _on_sections(system)
    if scene.solve.kind == "dynamic":
        x = np.zeros((system.rows, 3)) if system.laid is None else system.laid
        for body in system.net.bodies if system.contact and scene.solve.start == "web" else ():
            if not len(body.carried) and np.isfinite(body.extent):
                yield from _on_body(scene, system, body, x)
        if scene.throw is not None and scene.solve.start == "web":
            yield from _on_mouth(scene, system, x)


def _on_modulus(scene, system):
    """Find a modulus, or the largest slope of a curve, below that of rubber."""
    tables = {"[cable]": scene.cable} | {f"[cable.groups.{name}]": group for name, group in scene.cable.groups.items()}
    for where, table in tables.items():
        if table.modulus is not None and table.modulus < SOFTEST:
            text = f"{where} modulus = {table.modulus:g} Pa is below that of rubber, {SOFTEST:g} Pa: is it in MPa?"
            yield Finding("unit-in-doubt", text, "cable")
    for curve in system.net.kept:
        if curve.unit == "Pa" and curve.steepest < SOFTEST:
            text = f"the slopes of a curve are up to {curve.steepest:g} Pa, below that of rubber, {SOFTEST:g} Pa"
            yield Finding("unit-in-doubt", f"{text}: is its stress in MPa?", "cable")


def _on_cells(scene, system):
    """Find meshes that are large for a net."""
    web = system.net.web
    area = getattr(scene.web, "cell_area", None) or (web.area / web.cells if web.cells > 0 else 0.0)
    if area > LARGEST_CELL:
        text = f"a mesh of the web has {area:.4g} m², above {LARGEST_CELL:g} m²: are lengths in mm? They are read in m"
        yield Finding("unit-in-doubt", text, "web")


def _on_sections(system):
    """Find lines that are thicker than long."""
    net = system.net
    length = np.bincount(net.line, weights=net.natural_length, minlength=len(net.web.lines))
    diameter = np.zeros(len(length))
    diameter[net.line] = np.sqrt(4.0 / np.pi * net.area)
    thick = np.flatnonzero(diameter > length)
    if len(thick):
        line = int(thick[0])
        text = (
            f"line {line} is {readable(length[line], None, 'm')} long and {readable(diameter[line], None, 'm')} thick, "
            "as a round cable of its area is: is the area in mm²? It is read in m²"
        )
        yield Finding("unit-in-doubt", text, "cable")


def _on_body(scene, system, body, x):
    """Find a body that the web begins around, or that passes the web on its straight path."""
    positions = (system.net.points + x)[: system.net.nodes]
    centre = (system.net.points + x)[body.row]
    if _is_around(positions, centre, body.surface(centre)[0]):
        yield Finding(
            "starts-around",
            f'the web begins around body "{body.name}": its centre is between the nodes at the start; check position',
            "body",
        )
        return
    nearest = _nearest(scene, system, body, x)
    if nearest is None:
        return
    distances, size = np.maximum(nearest - body.extent, 0.0), 2.0 * body.extent
    gap = float(distances.min())
    if gap > size:
        text = (
            f'body "{body.name}" flies past the web: on straight paths a gap of {readable(gap, None, "m")} stays '
            f"between them, more than its size, {readable(size, None, 'm')}; check position and velocity"
        )
        yield Finding("flies-past", text, "body")
    elif distances[0] > 0.0 and (np.diff(distances) > 0.0).all():
        yield Finding("flies-past", f'body "{body.name}" flies away from the web; check the sign of velocity', "body")


def _is_around(positions, centre, surface):
    """Tell if a body is between nodes: its centre in their hull, of a flat web in the outline, and on both sides."""
    from scipy.spatial import ConvexHull, QhullError

    middle = positions.mean(axis=0)
    _, sizes, axes = np.linalg.svd(positions - middle, full_matrices=False)
    if len(sizes) < 3 or sizes[1] <= FLAT * sizes[0]:
        return False
    flat = sizes[2] <= FLAT * sizes[0]
    places, centre = (positions - middle) @ axes.T, axes @ (centre - middle)
    sides = (surface - middle) @ axes[2]
    if flat and not sides.min() < 0.0 < sides.max():
        return False
    kept = 2 if flat else 3
    try:
        hull = ConvexHull(places[:, :kept])
    except QhullError:
        return False
    return bool((hull.equations[:, :kept] @ centre[:kept] + hull.equations[:, kept] < 0.0).all())


def _nearest(scene, system, body, x):
    """Distance of the centre of a body from the nearest line over time, shape (times,), None where it says nothing.

    Body and nodes go on as they start, and the body as its forces accelerate it at the start; a web that floats falls
    as it does.
    """
    net, v = system.net, system.initial_velocity()
    if any(term.frame.angular_velocity is not None for term in system.terms):
        return None
    count = int(min(TIMES, PAIRS // max(len(net.web.lines), 1)))
    nodes = net.nodes
    moves = np.abs(v[:nodes] - v[body.row]).max(initial=0.0)
    if count < 2 or not moves > 0.0 or system.drives:
        return None
    acceleration = np.zeros(3)
    if not body.prescribed and system.fixed[:nodes].any():
        acceleration = system.force(0.0, x, v)[body.row] / net.mass[body.row]
    start = net.points + x
    ends = net.web.lines
    distances = []
    for t in np.linspace(0.0, scene.solve.duration, count):
        centre = start[body.row] + t * v[body.row] + 0.5 * t * t * acceleration
        at = start[: len(net.web.points)] + t * v[: len(net.web.points)]
        distances.append(_to_lines(centre, at[ends[:, 0]], at[ends[:, 1]]))
    step = scene.solve.duration / (count - 1)
    path = np.linalg.norm(v[body.row] - v[:nodes].mean(axis=0) + 0.5 * scene.solve.duration * acceleration)
    distances = np.array(distances)
    distances[1:] -= np.minimum(0.5 * path * step, 0.5 * distances[1:])  # what lies between two of the times
    return distances


def _to_lines(centre, first, last):
    """Distance of a centre from the nearest of some lines [m]."""
    along = last - first
    share = ((centre - first) * along).sum(axis=1) / np.maximum((along * along).sum(axis=1), 1e-300)
    foot = first + np.clip(share, 0.0, 1.0)[:, None] * along
    return float(np.sqrt(((centre - foot) ** 2).sum(axis=1).min()))


def _on_mouth(scene, system, x):
    """Find a mouth that is as open at the start as it counts as effective."""
    from ..results.observables.distances import MouthArea
    from ..results.state import State

    observe = next(o for o in scene.observables if o.name == scene.throw.area)
    mouth = MouthArea(observe)
    area, largest = mouth.of(State(system, 0.0, x)).value, _largest_area(system.net.web, mouth.rows(system))
    if largest is not None and area >= scene.throw.share * largest:
        text = (
            f"the net starts open: its mouth has {area:.4g} m² at the start, and {largest:.4g} m² at most, so that "
            "deployment_time and effective_period begin at once; [fold] packs it"
        )
        yield Finding("starts-open", text, table="throw")


def _largest_area(web, mouth):
    """Largest area of a mouth that lines between its nodes allow [m²], None where some are not joined.

    Its sides are as long as the shortest way along lines, and a polygon of given sides is largest in a circle.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import dijkstra

    n = len(web.points)
    graph = coo_array((web.natural_length, tuple(web.lines.T)), shape=(n, n)).tocsr()
    ways = dijkstra(graph, directed=False, indices=mouth)[np.arange(len(mouth)), np.roll(mouth, -1)]
    if not np.isfinite(ways).all() or (ways <= 0.0).any():
        return None
    longest = ways.max()
    if 2.0 * longest >= ways.sum():
        return None

    def angles(radius, outside):
        turned = 2.0 * np.arcsin(np.minimum(0.5 * ways / radius, 1.0))
        if outside:
            turned[ways.argmax()] = 2.0 * np.pi - turned[ways.argmax()]
        return turned

    low = high = 0.5 * longest
    outside = angles(low, False).sum() < 2.0 * np.pi  # the centre is beyond the longest side
    while (angles(high, outside).sum() < 2.0 * np.pi) == outside and high < 1e9 * longest:
        high *= 2.0
    for _ in range(100):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if (angles(middle, outside).sum() < 2.0 * np.pi) == outside else (low, middle)
    return float(0.5 * high**2 * np.sin(angles(high, outside)).sum())
