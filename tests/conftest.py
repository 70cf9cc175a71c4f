"""Processes that tests start run the code under test, from whatever folder: not what is installed beside it.

They compile without a second process, and libraries have one thread: the workers of the tests fill the cores. And they
read bytecode that the first of them has written, which takes each 0.4 s less than to read sources.
"""

import fnmatch
import gc
import os
import pathlib
import sys

import pytest

from refweb.sweeps.threads import use_one

use_one()
_before = os.environ.get("PYTHONPATH")
os.environ["PYTHONPATH"] = os.pathsep.join([str(pathlib.Path(__file__).parents[1]), *([_before] if _before else [])])
os.environ.setdefault("REFWEB_COMPILERS", "1")
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False


@pytest.fixture(autouse=True, scope="session")
def quiet():
    """No line of progress in what tests read of the error stream, however long a busy machine takes."""
    from refweb.results import progress

    progress.EVERY = 1e6


def pytest_collection_finish():
    """Leave out of garbage collection what stays anyway: modules and tests, a tenth of the time of all tests."""
    gc.collect()
    gc.freeze()
    gc.set_threshold(20_000, 10, 20)


MANY = 5000
"""Number of tests from which on all files are collected whole, so that each variant that is named must be there."""


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items):
    """Mark as slow the variants of a test that ``@pytest.mark.ordinary(...)`` does not name, by their ids or patterns.

    Of values that are alike, as CVODE and IDA or three meshes, the ordinary run may keep one alone; of others it has
    each in one variant at least. The slow run has what is left. Bugs of ``tests/mutants.py`` are looked for by ordinary
    tests: try those of a file before one of its tests is marked as slow.
    """
    unused = {}
    for item in items:
        if (mark := item.get_closest_marker("ordinary")) is None:
            continue
        named = [pattern for pattern in mark.args if fnmatch.fnmatchcase(item.callspec.id, pattern)]
        if not named:
            item.add_marker(pytest.mark.slow)
        unused.setdefault(item.nodeid.partition("[")[0], set(mark.args)).difference_update(named)
    if len(items) > MANY and (wrong := {test: sorted(left) for test, left in unused.items() if left}):
        raise pytest.UsageError(f"variants that are named ordinary and are not there: {wrong}")
