"""Runs the validation cases and writes their report: ``python -m validation [--quick] [--list] [NAMES]``."""

from __future__ import annotations

import argparse
import importlib.util
import pathlib
import sys
import time

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

from refweb.messages import nearest

from .harness import page as report
from .harness.case import Case, names, run, text

EXTRAS = ("pytest", "mpmath", "clarabel")
"""What cases import that refweb does not need."""
FOLDER = pathlib.Path(__file__).parent / "report"


def main(arguments=None):
    """Run; the status is 1 where a case fails and 2 for wrong input."""
    parser = argparse.ArgumentParser(prog="python -m validation", description=__doc__)
    parser.add_argument("names", nargs="*", metavar="NAMES", help="cases to run, by default all")
    parser.add_argument("--quick", action="store_true", help="the same assertions on smaller scenes")
    parser.add_argument("--list", action="store_true", help="print the names of the cases and stop")
    parser.add_argument("--out", type=pathlib.Path, default=FOLDER, help="folder of the report")
    parser.add_argument("--text", type=pathlib.Path, metavar="FILE", help="write the text of the report as well")
    given = parser.parse_args(arguments)
    missing = [name for name in EXTRAS if importlib.util.find_spec(name) is None]
    if missing and not given.list:
        parser.exit(2, f"{parser.prog}: needs {', '.join(missing)}: python -m pip install -e '.[test]'\n")
    if given.list:
        for name in names():
            print(f"{name:28s} {text(name)[0]}")
        return 0
    for name in given.names:
        if name not in names():
            parser.error(f"{name}: no such case, {nearest(name, names())}")
    chosen = [name for name in names() if name in given.names or not given.names]
    console, done = Console(highlight=False, width=None if sys.stdout.isatty() else 110), []
    columns = BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(), TextColumn("{task.description}")
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("", total=len(chosen) + 1)
        for name in chosen:
            bar.update(task, description=name)
            began = time.perf_counter()
            try:
                case = run(name, given.quick)
            except Exception as error:  # the other cases still have something to say
                case = Case(failure=f"{type(error).__name__}: {error}")
            done.append(report.Done(name, case, time.perf_counter() - began))
            failures = case.failures
            count = f"{len(case.rows)} comparisons, {len(case.verdicts)} verdicts, {done[-1].seconds:.1f} s"
            console.print(f"{'fails' if failures else 'agrees'}  {name}: {count}", markup=False)
            for failure in failures:
                console.print(f"        {failure}", markup=False)
            bar.advance(task)
        bar.update(task, description="drawing the report")
        page = report.write(given.out, done, given.quick)
        if given.text is not None:
            report.write_text(given.text, done, given.quick)
    print(f"report in {page}")
    return int(any(one.case.failures for one in done))


if __name__ == "__main__":
    sys.exit(main())
