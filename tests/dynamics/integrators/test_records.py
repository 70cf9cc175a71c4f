"""Records of the compiled loop: numba types the first of each class alone, so all others must have its types."""

import tomllib
from pathlib import Path

import numba
import pytest

import refweb
from refweb.dynamics.integrators import central_difference

SCENES = Path(refweb.__file__).parent / "scenes"


class Seen(Exception):
    """The loop was reached."""


@pytest.mark.parametrize(
    "name, changes",
    [
        ("square-impact", {}),
        ("square-impact", {"method": "explicit", "safety": 0.9}),
        ("square-impact", {"step_size": 1e-5}),
        ("closing-net", {}),
        ("spinning-web", {}),
        ("ring-on-slack-cable", {}),
    ],
)
def test_every_record_of_a_class_has_the_same_types(name, changes, monkeypatch):
    """What numba finds when it looks at every field is what it is told."""

    def look(times, breath, limit, *records_and_history):
        for record in records_and_history[:-1]:
            assert numba.typeof(record) == record._numba_type_
        raise Seen

    monkeypatch.setattr(central_difference, "advance_rows", look)
    given = tomllib.loads((SCENES / f"{name}.toml").read_text())
    given["solve"].update(changes)
    with pytest.raises(Seen):
        refweb.run(refweb.Scene.from_dict(given))
