"""Threads of libraries: one each, as far as nothing else is asked for.

OpenBLAS takes all cores for the product of two vectors of more than 10 000 numbers. Its threads look for the next
product in a loop before they sleep: with one product in each evaluation, a CVODE run of 10 167 unknowns takes 30 s of
CPU time in place of 15, and the same time by the clock. The sum of several threads differs in its last digits with
their number; that of one does not depend on the machine.

May change: `ONE_THREAD`, where a library brings another variable. Must stay: nothing is imported that loads such a
library, which reads its variable only once; both names, which `refweb.__main__`, `workers`, tests and validation
import. Tests: ``tests/commands/test_cli.py``, ``tests/sweeps/test_workers.py``.
"""

from __future__ import annotations

import os

ONE_THREAD = dict.fromkeys(
    ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS"), "1"
)
"""Environment variables for the number of threads of libraries, and what asks for one."""


def use_one():
    """Ask for one thread of each library that is not loaded yet, where the environment names no number."""
    for name, number in ONE_THREAD.items():
        os.environ.setdefault(name, number)
