"""Packages of plug-ins, as an installer leaves them in a folder: modules, and the entry points that pages show."""

import contextlib
import re
import sys
import textwrap
import tomllib

import pytest

from refweb import registry

BLOCK = re.compile(r"::\n\n((?:    .*\n?|\n)+)")


def blocks(page):
    """Blocks of code of a docstring, in their order."""
    return [textwrap.dedent(block).replace("'''", '"""') for block in BLOCK.findall(page)]


def entry_point(block):
    """(group, name, module, attribute) of an entry point as ``pyproject.toml`` has it."""
    ((group, entries),) = tomllib.loads(block)["project"]["entry-points"].items()
    ((name, value),) = entries.items()
    return group, name, *value.partition(":")[::2]


def install(folder, modules, entries, package="my_webs", version="1.2"):
    """Write a package of modules, texts by name, and its metadata with entry points, pairs of group and line."""
    root = folder / package
    root.mkdir(parents=True)
    (root / "__init__.py").touch()
    for name, text in modules.items():
        (root / f"{name}.py").write_text(text, encoding="utf-8")
    metadata = folder / f"{package}-{version}.dist-info"
    metadata.mkdir()
    (metadata / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {package}\nVersion: {version}\n")
    (metadata / "entry_points.txt").write_text("\n".join(f"[{group}]\n{line}\n" for group, line in entries))


@contextlib.contextmanager
def installed(folder, modules, entries, package="my_webs"):
    """Install a package, see `install`, for this process; nothing is left of it behind the block."""
    install(folder, modules, entries, package)
    before = {kind: dict(entry.table) for kind, entry in registry.KINDS.items()}
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(folder)
        registry.installed.cache_clear()
        yield
    registry.installed.cache_clear()
    registry.PACKAGES.pop(package, None)
    for kind, entry in registry.KINDS.items():
        entry.table.clear()
        entry.table.update(before[kind])
    for module in [module for module in sys.modules if module.split(".")[0] == package]:
        del sys.modules[module]


@contextlib.contextmanager
def of_page(folder, source, entry):
    """Install the package that a page tells of: its file, and its entry point."""
    group, name, module, attribute = entry_point(entry)
    value = f"{module}:{attribute}" if attribute else module
    with installed(folder, {module.partition(".")[2]: source}, [(group, f"{name} = {value}")]):
        yield
