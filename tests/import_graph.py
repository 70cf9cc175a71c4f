"""Imports of the package, read off its files: what a module imports at its head, and anywhere.

Attributes
----------
MODULES : mapping of ast.Module
    What runs of each file, by the name of the module below the package; a file is parsed when it is first asked for.
PACKAGES : set of str
    Names of those that are folders.
"""

import ast
import functools
import pathlib
from collections.abc import Mapping

import refweb

ROOT = pathlib.Path(refweb.__file__).parent


def name_of(path):
    """Name of a module below the package, "" for the package itself."""
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def parsed(path):
    """What runs of a file: without what stands there for type checkers alone."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    for node in reversed(tree.body):
        if isinstance(node, ast.If) and isinstance(node.test, ast.Name) and node.test.id == "TYPE_CHECKING":
            at = tree.body.index(node)
            tree.body[at : at + 1] = node.orelse
    return tree


class _Modules(Mapping):
    def __init__(self, files):
        self._files, self._parsed = files, {}

    def __getitem__(self, name):
        if name not in self._parsed:
            self._parsed[name] = parsed(self._files[name])
        return self._parsed[name]

    def __contains__(self, name):
        return name in self._files

    def __iter__(self):
        return iter(self._files)

    def __len__(self):
        return len(self._files)


MODULES = _Modules({name_of(path): path for path in sorted(ROOT.rglob("*.py"))})
PACKAGES = {name_of(path) for path in ROOT.rglob("__init__.py")}


def imported(name, node):
    """Absolute names that an import statement asks for; those of refweb begin with "refweb."."""
    if isinstance(node, ast.Import):
        return [alias.name for alias in node.names]
    base = node.module or ""
    if node.level:
        here = ["refweb", *name.split(".")] if name else ["refweb"]
        here = here if name in PACKAGES else here[:-1]
        base = ".".join([*here[: len(here) - node.level + 1], *filter(None, [base])])
    return [f"{base}.{alias.name}" for alias in node.names]


@functools.cache
def nodes_of(name):
    """All nodes of a module, as `ast.walk` finds them."""
    return tuple(ast.walk(MODULES[name]))


def imports(name, tree=None):
    """Absolute names of all imports in a module."""
    nodes = nodes_of(name) if tree is None else ast.walk(tree)
    return [found for node in nodes if isinstance(node, ast.Import | ast.ImportFrom) for found in imported(name, node)]


def at_head(tree):
    """Statements that run when a module is imported."""
    for node in tree.body:
        if not isinstance(node, ast.FunctionDef | ast.ClassDef):
            yield node
        elif isinstance(node, ast.ClassDef):
            yield from at_head(node)


@functools.cache
def uses(name, tree=None):
    """Modules of the package that a module imports, or a part of it, the longest name that is one."""
    found = set()
    for absolute in imports(name, tree):
        parts = absolute.split(".")
        if parts[0] == "refweb":
            below = [".".join(parts[1:end]) for end in range(len(parts), 0, -1)]
            found.add(next(module for module in below if module in MODULES))
    return found


def loaded_with(names):
    """Modules of the package that importing some brings: their packages, and what all these import at their heads."""
    found, left = set(), list(names)
    while left:
        name = left.pop()
        if name and name not in found:
            found.add(name)
            left += [name.rpartition(".")[0], *(used for node in at_head(MODULES[name]) for used in uses(name, node))]
    return found
