"""Tables as values of Python: keys that are misspelt, missing or without a name, and what editors know of them."""

import ast
import copy
import inspect
import math
import pathlib
import pickle
import re

import pytest

import refweb
from refweb.registry import exports, load
from refweb.tables import Table, checked, node_number, numbers_list, read_all, real, rows

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


WRONG = [math.nan, math.inf, 1e101, -1e101, 10**400, True, "1", None, [1.0]]


@pytest.mark.parametrize("wrong", WRONG, ids=repr)
@pytest.mark.parametrize("place", [0, 2, 4])
def test_lists_that_are_read_at_once_refuse_what_a_number_alone_refuses(wrong, place):
    good = [1.0, 2, -3.0, 0.0, 5.0]
    assert checked("k", good, numbers_list()) == tuple(checked(f"k[{i}]", x, real()) for i, x in enumerate(good))
    assert all(type(x) is float for x in checked("k", good, numbers_list()))
    given = [*good[:place], wrong, *good[place + 1 :]]
    with pytest.raises(refweb.InputError) as alone:
        checked(f"k[{place}]", wrong, real())
    with pytest.raises(refweb.InputError, match=re.escape(str(alone.value))):
        checked("k", given, numbers_list())
    with pytest.raises(refweb.InputError, match=re.escape(str(alone.value).replace("k[", "k[1]["))):
        checked("k", [good, given], rows(5))


@pytest.mark.parametrize("wrong", [-1, 2**63, 1.0, True, "1"], ids=repr)
def test_lists_of_nodes_refuse_what_is_no_node(wrong):
    assert checked("k", [[0, 1], (2**62, 3)], rows(2, number=node_number)) == ((0, 1), (2**62, 3))
    with pytest.raises(refweb.InputError, match=re.escape("k[1][0] = ")):
        checked("k", [[0, 1], [wrong, 3]], rows(2, number=node_number))


@pytest.mark.parametrize(
    ("bounds", "wrong"),
    [({"above": 0}, 0.0), ({"above": 0}, 1e-101), ({"above": 2}, 2.0), ({"at_least": 2}, 1.0), ({"below": 3}, 3.0),
     ({"at_most": 4}, 5.0)],
)  # fmt: skip
def test_bounds_hold_in_lists(bounds, wrong):
    read = real(**bounds).metadata["read"]
    assert read_all("k", [2.5, 2.75], read) == [2.5, 2.75]
    with pytest.raises(refweb.InputError, match=re.escape(f"k[1] = {wrong:g}")):
        read_all("k", [2.5, wrong], read)
