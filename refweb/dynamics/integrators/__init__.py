"""Integrators: a system through time, seen by probes; they know no scene, no files and no errors of results.

How to write an integrator
--------------------------
A method that takes steps of its own choice, as its tolerances ask for, is a `StepObserver` and brings three methods.
Rows, books, extremes, events, ± and refusals are made around its steps. A whole file, ``my_webs/heun.py``::

    '''Heun's method: Euler's step and, by the slopes at its end, a correction, which is taken for the error.'''

    import numpy as np

    from refweb.dynamics.integrators.step_observer import StepObserver


    class Heun(StepObserver):
        method, order = "heun", 2

        def begin(self, t, x, v):
            self.now, self.h = (t, x, v, self.acceleration(t, x, v)), 1e-9

        def step(self, stop, end):
            (t, x, v, a), share = self.now, 2.0
            while share > 1.0:
                h = min(self.h, stop - t)
                b = self.acceleration(t + h, x + h * v, v + h * a)
                more = 0.5 * h * h * a, 0.5 * h * (b - a)
                share = self.over_tolerance(*more, x, v)
                self.h = h * min(2.0, 0.9 / np.sqrt(share + 1e-3))
            x, v = x + h * v + more[0], v + h * a + more[1]
            self.before, self.now = self.now, (t + h, x, v, self.acceleration(t + h, x, v))
            return t + h

        def interpolated(self, t):
            (start, x, v, a), (end, y, w, b) = self.before, self.now
            h, s = end - start, (t - start) / (end - start)
            cubic = lambda p, p_rate, q, q_rate: (
                p + s * s * (3.0 - 2.0 * s) * (q - p) + h * s * (1.0 - s) * ((1.0 - s) * p_rate - s * q_rate)
            )
            return cubic(x, v, y, w), cubic(v, a, w, b)

An entry point of your package makes it a ``method`` of scenes, in a script ``refweb.register("integrator", "heun",
Heun)``; one that refweb ships is a line in `refweb.registry.INTEGRATORS`. Its ``keys``, by default ``rtol`` and the
absolute tolerances, are those of ``[solve]`` that it takes::

    [project.entry-points."refweb.integrators"]
    heun = "my_webs.heun:Heun"

``x`` and ``v`` are displacement and velocity of all that is free, vectors; ``begin`` is also called in the middle of a
run, where velocities jump. No step passes ``stop``, where tables have corners and bodies might pass through lines; the
next row, ``end``, may be passed. ``over_tolerance(error_x, error_v, x, v)`` is an error over what the tolerances allow,
1 at their limit. A step that is not found raises `Stopped` of the same module with the reason.

An implicit method finds K = −∂f/∂x and C = −∂f/∂v by ``self.system.stiffness(t, *self.state(t, x, v))`` and
``damping``, None without any: values of which ``self.system.pattern.matrix`` makes a sparse matrix, as M is in
``self.system.mass.matrix``, all over the free unknowns. Tangents and factorizations of its own it counts in
``self.stats``, as ``njev`` and ``nlu``. ``self.force`` is f, and ``self.acceleration`` M⁻¹f. A method says by
``takes_massless`` and ``takes_links`` that its equations have a place for nodes without mass and rigid links, and
by ``restarts`` that it is to begin anew at corners. `refweb.dynamics.integrators.integrator.Integrator` describes all
attributes of an integrator, also of one that chooses steps by another key than rtol.
"""

# This docstring is a page of the site and of ``refweb help own-integrator``. Its words may change freely; its first
# sentence stays as in tests/test_architecture.py, and the names in it are those of `step_observer` and `integrator`;
# tests/how_to/test_integrator.py runs its example. This file stays without code.
