"""Compares refweb with its peers: ``python -m validation.peers [PEERS] [--work WORKS] [--python PATH] [--quick]``."""

from __future__ import annotations

import argparse
import pathlib
import sys

from refweb.messages import nearest

from . import page, runs, start
from .compare import Comparison
from .work import works

FOLDER = pathlib.Path(__file__).parents[1] / "report" / "peers"
PAIRS, BUDGET = 10, 30.0
"""Pairs of runs for each peer and work, and the time that they may take [s]."""


def main(arguments=None):
    """Compare; the status is 2 for wrong input."""
    known = works()
    parser = argparse.ArgumentParser(prog="python -m validation.peers", description=__doc__)
    parser.add_argument("peers", nargs="*", metavar="PEERS", help=f"{', '.join(runs.ORDER)}; by default all")
    parser.add_argument("--work", nargs="*", default=[], metavar="WORKS",
                        help=f"{', '.join(known)}, start, or how names begin; by default all but start")  # fmt: skip
    parser.add_argument("--out", type=pathlib.Path, default=FOLDER, help="folder of what is measured and of the page")
    parser.add_argument("--python", default=sys.executable, help="interpreter that the peers are installed for")
    parser.add_argument("--full", action="store_true", help=f"{PAIRS} pairs, however long they take")
    parser.add_argument("--limit", type=float, default=300.0, help="longest time of a run [s]")
    parser.add_argument("--quick", action="store_true", help="small nets, short motions and one pair")
    parser.add_argument("--text", type=pathlib.Path, metavar="FILE", help="write the page to a file of its own")
    parser.add_argument("--no-runs", action="store_true", help="write the page of what is measured, and run nothing")
    parser.add_argument("--list", action="store_true", help="print works and peers, with versions, and stop")
    given = parser.parse_args(arguments)
    for name in given.peers:
        if name not in runs.ORDER:
            parser.error(f"{name}: no such peer, {nearest(name, runs.ORDER)}")
    for name in given.work:
        if not any(one.startswith(name) for one in (*known, "start")):
            parser.error(f"{name}: no such work, {nearest(name, (*known, 'start'))}")
    machine = runs.machine(given.python, given.limit)
    names = ["refweb", *(name for name in runs.ORDER if name in given.peers or not given.peers)]
    versions = {name: runs.version(machine, name) for name in names}
    for name, (version, reason) in versions.items():
        print(version or f"{name} is left out: {reason}", flush=True)
    if given.list:
        print("\n".join(f"{work.name}: {work.title}" for work in known.values()))
        return 0
    given.out.mkdir(parents=True, exist_ok=True)
    there = [name for name in names if versions[name][0]] if not given.no_runs else []
    done = []
    for work in known.values():
        if not given.work or any(work.name.startswith(name) for name in given.work):
            found = compared(work, there, machine, given)
            done += [found] if found.records else []
    if there and any("start".startswith(name) for name in given.work):
        start.compare(there, given.out, tell)
    print(f"page in {page.write(given.out, done, versions, start.compare((), given.out), given.text)}")
    return 0


def compared(work, names, machine, given):
    """The `Comparison` of a work."""
    found = Comparison(work, machine, given.out, given.quick, tell)
    taking = [name for name in names if found.takes(name)]
    found.ladder(taking)
    for peer in taking[1:] if "refweb" in taking else ():
        found.pairs(peer, 1 if given.quick else PAIRS, float("inf") if given.full else BUDGET)
    return found


def tell(line):
    print(line, flush=True)


if __name__ == "__main__":
    sys.exit(main())
