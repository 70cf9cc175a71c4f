"""± of runs of one row, whose results are compared with those of the twin at times between as well."""

import numpy as np

import refweb


def impact(duration, interval, observe, **solve):
    """A ball that flies into a small slack web and out again."""
    return refweb.run(
        refweb.Scene(
            web=refweb.Window(mesh="square", rows=2, columns=2, side=0.2),
            cable=refweb.Cable(law="tension-only", modulus=1e7, area=1e-5, density=200.0),
            effects=[
                refweb.Body(name="ball", radius=0.1, mass=0.05, position=(0.01, 0.02, -0.1), velocity=(0.0, 0.0, 3.0)),
                refweb.Contact(stiffness=2e3),
            ],
            solve=refweb.Dynamic(duration=duration, **solve),
            output=refweb.Output(interval=interval),
            accuracy=refweb.Accuracy(error="none" if solve else "twin"),
            observe=observe,
        )
    )


def test_one_row_has_the_errors_of_many():
    """Against Adams at 1e-9: at 24 ends of the impact no result is off by more than ±, and ± is no excuse."""
    observe = [
        refweb.Observe(name="x", quantity="displacement", body="ball", component="z", reduce="final"),
        refweb.Observe(name="v", quantity="velocity", body="ball", component="z", reduce="final"),
    ]
    ends = 1e-3 * np.arange(1, 25)
    truth = impact(ends[-1], 1e-3, observe, method="cvode", family="adams", rtol=1e-9).history
    assert truth["v"].max() > 2.9 and truth["v"][-1] < 1.5
    for n, end in enumerate(ends, 1):
        solution = impact(float(end), float(end), observe)
        assert len(solution.history["time"]) == 2
        for name, scale in (("x", 0.03), ("v", 3.0)):
            result = solution.reduced[name]
            assert abs(result.value - truth[name][n]) <= result.error < 0.1 * scale, (end, name, result)
