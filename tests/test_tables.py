"""Tables as values of Python: keys that are misspelt, missing or without a name, and what editors know of them."""

import ast
import copy
import inspect
import pathlib
import pickle

import pytest

import refweb
from refweb.registry import exports, load
from refweb.tables import Table

CLASSES = [
    name for name, place in exports().items() if isinstance(load(place), type) and issubclass(load(place), Table)
]


@pytest.mark.parametrize("name", [*CLASSES, "Scene"])
def test_a_misspelt_key_is_answered_with_the_nearest(name):
    cls = getattr(refweb, name)
    key = max((key for key in inspect.signature(cls).parameters if key != "given"), key=len, default="position")
    wrong = key + "x"
    with pytest.raises(refweb.InputError) as refused:
        cls(**{wrong: 1})
    assert str(refused.value) == f'{wrong} = 1: unknown key, did you mean "{key}"?'


def test_a_missing_key_is_named_with_its_unit():
    with pytest.raises(refweb.InputError, match=r"^area is missing: give area = \.\.\. \[m²\]$"):
        refweb.Cable(modulus=1e9, density=1.0)
    with pytest.raises(refweb.InputError, match=r"^position is missing: give position = \.\.\. \[m\]$"):
        refweb.Body(name="ball", radius=1.0)
    with pytest.raises(refweb.InputError, match="^web is missing"):
        refweb.Scene()


def test_tables_are_values():
    """They compare, copy and pickle as what they hold."""
    body = refweb.Body(name="ball", radius=1.0, mass=1.0, position=(0, 0, 0))
    for value in (refweb.Cable(modulus=1.0, area=1.0, density=1.0, groups={"rim": {"area": 2.0}}), body):
        assert copy.deepcopy(value) == value == pickle.loads(pickle.dumps(value))
    assert body != refweb.Body(name="ball", radius=2.0, mass=1.0, position=(0, 0, 0))


def test_editors_know_the_names_of_the_package():
    """`refweb.registry.exports` is what the package has at run time; the imports for type checkers are the same."""
    package = pathlib.Path(refweb.__file__)
    known = [
        node for node in ast.walk(ast.parse(package.read_text())) if isinstance(node, ast.ImportFrom) and node.names
    ]
    told = {a.asname: f"refweb.{n.module}:{a.name}" for n in known for a in n.names if a.asname is not None}
    assert told == exports(), "add the line to refweb/__init__.py"
    assert (package.parent / "py.typed").exists()
