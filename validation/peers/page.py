"""The page of a comparison, as Markdown with its picture; on the documentation site it is the page ``peers``."""

from __future__ import annotations

import ast
import os
import pathlib
import platform
import statistics

import numpy as np

from ..harness import plots
from . import runs

PICTURES = pathlib.Path(__file__).parents[1] / "pictures"
ENOUGH = 10
"""Pairs from which on a ratio is a claim."""
CURVES = {
    "peers.png": ("of the impact", "impact-error", "implicit"),
    "peers-capture.png": ("of the throw and, dashed, of the capture", "throw", "capture"),
}
"""Pictures: words, and works, of which the second is dashed."""
BUSY = 1.5
"""Wall time over CPU time from which on a page says that the machine was busy."""
INTRODUCTION = """# Beside its peers

`python -m validation.peers` gives one problem as plain arrays to refweb and to other programs, each as its users would
write it, and measures them beside each other. All numbers of this page come from that command.

- **Error** is the distance of the farthest node from the right place, and the largest difference of a tension. What is
  right is computed twice, by refweb with all its digits and by a method in NumPy and SciPy that shares no line with it;
  each section says how far the two differ.
- **CPU and wall time** are those of the call that builds the model and solves it, without the import of the library,
  the least of all runs. What compiles when it is called is called twice: "first" has the first call. Each run is a
  process of its own with one thread; **memory** is the peak of that process, libraries included.
- **× refweb** is the median of the ratios of CPU times in pairs of runs, one right after the other, first the one and
  then the other, and in brackets the number of pairs. Below ten pairs it is no claim. "m off" is the least error of a
  program that does not reach the target, since its elements or its contact are another model.
- **Lines** are those of the program that the work needs, imports included, without comments and empty lines; contact
  forces and draws that several programs take from one file are not counted.
- refweb runs without its own estimate of errors in dynamics, `[accuracy] error = "none"`, since no other program makes
  one; by default it makes a second run for it. In statics its bounds are included.
"""
CORRECTIONS = """## Corrections

Whoever knows one of these programs better is asked to correct its file in `validation/peers/programs/`: a faster
set-up, a better method, an element that fits. `python -m validation.peers mujoco --work impact` measures one peer on
works whose names begin so, `--quick` tries it on a small net in seconds, and `tests/test_peers.py` holds each program
against methods in NumPy where the peer is installed. What is measured is kept in `validation/report/peers/`; a command
that was stopped goes on there, and a changed program is measured anew with another `--out`. `--python PATH` takes peers
from another environment, `--full` takes ten pairs of every peer however long that lasts, and `--work start` installs
each program in an empty environment.
"""


def write(folder, done, versions, start, target=None):
    """Write the page and its pictures.

    Parameters
    ----------
    folder : pathlib.Path
    done : list of Comparison
    versions : dict
        Version and reason of absence of each program.
    start : dict
        What `validation.peers.start` has measured.
    target : pathlib.Path, optional
        File of the page outside of the folder; its pictures are then in ``validation/pictures``.
    """
    pictures = folder if target is None else PICTURES
    target = target or folder / "peers.md"
    parts = [INTRODUCTION.strip(), programs(versions), business(done), summary(done)]
    for name, (words, *works) in CURVES.items():
        curves = [one for one in done if one.work.name in works]
        if any(points(one, program) for one in curves for program in one.settings):
            (pictures / name).write_bytes(plots.image(drawn(curves)).png)
            link = os.path.relpath(pictures / name, target.parent).replace(os.sep, "/")
            parts.append(f"![Error over CPU time {words}, by program]({link})")
    parts += [section(one) for one in done]
    parts += [started(start), CORRECTIONS.strip()]
    target.write_text("\n\n".join(filter(None, parts)) + "\n", encoding="utf-8")
    return target


def table(heads, rows):
    """A table in Markdown."""
    cells = [heads, ["---"] * len(heads), *rows]
    return "\n".join("| " + " | ".join(str(cell).replace("|", "\\|") for cell in row) + " |" for row in cells)


def machine():
    """CPU, system and interpreter in words."""
    info = pathlib.Path("/proc/cpuinfo")
    text = info.read_text(encoding="utf-8").splitlines() if info.exists() else []
    names = [line.partition(":")[2].strip() for line in text if line.startswith("model name")]
    cpu = (names or [platform.processor() or platform.machine()])[0]
    return f"{cpu}, {os.cpu_count()} cores, {platform.system()}, Python {platform.python_version()}"


def programs(versions):
    """The machine, and each program with its version and how it is set up."""
    rows = []
    for name, (version, reason) in versions.items():
        text = (runs.PROGRAMS / f"{name}.py").read_text(encoding="utf-8")
        words = " ".join(ast.get_docstring(ast.parse(text)).split())
        rows.append([f"`{name}`", version or f"left out: {reason}", words])
    return f"Machine: {machine()}.\n\n" + table(["program", "version", "set-up"], rows)


def business(done):
    """A note where other programs have used the machine."""
    shares = [r["wall"] / r["cpu"] for one in done for r in one.records if r.get("cpu", 0.0) > 0.1]
    if not shares or statistics.median(shares) < BUSY:
        return ""
    return (
        f"The machine had other things to do: wall times are {statistics.median(shares):.1f} times CPU times in the "
        "median, and CPU times themselves vary by tens of per cent."
    )


def ratio(comparison, name):
    """Median ratio of CPU times of a peer and refweb, in words; a dash where there is none."""
    ratios = comparison.ratios(name)
    if not ratios:
        return "–"
    return f"{statistics.median(ratios):.2g} ({len(ratios)})"


def summary(done):
    """Ratios of all peers and works."""
    peers = [name for name in runs.ORDER if any(one.of(name) for one in done)]
    if not peers:
        return ""
    rows = [[f"`{name}`", *(verdict(one, name) for one in done)] for name in peers]
    heads = ["CPU time, × refweb (pairs)", *(one.work.title for one in done)]
    return "## In one table\n\n" + table(heads, rows)


def verdict(comparison, name):
    """The ratio, or why there is none."""
    if not comparison.of(name):
        return "–"
    if all("failure" in r for r in comparison.of(name)):
        return "fails"
    if comparison.chosen(name) is not None:
        return ratio(comparison, name)
    return f"{min(r['error'] for r in comparison.of(name) if 'error' in r):.0e} m off"


def given(settings):
    """Settings in words."""
    words = (f"{k} = {v:g}" if isinstance(v, int | float) else f"{k} = {v}" for k, v in settings.items())
    return ", ".join(words) or "as they are"


def section(comparison):
    """One work: what is computed, what is right, and a table."""
    work = comparison.work
    truth = comparison.truth
    right = f"Right: {truth.said}" + (f"; they differ by {truth.apart:.0e} m." if truth.apart else ".")
    rows = [row(comparison, name) for name in ("refweb", *runs.ORDER) if comparison.of(name)]
    heads = ["program", "lines", "with", "error [m]", "of tensions [N]", "CPU [s]", "first [s]", "wall [s]"]
    quick = f"\n\nQuick variant: {extent(comparison.problem)}." if comparison.quick else ""
    text = f"## {work.title}\n\n{work.said}{quick}\n\n{right}\n\n" + table([*heads, "memory [MB]", "× refweb"], rows)
    failures = [r for r in comparison.records if "failure" in r]
    told = {f"`{r['program']}`, {given(r['settings'])}: {in_own_words(r)}" for r in failures}
    return text + ("\n\nIn their own words:\n\n" + "\n".join(f"- {line}" for line in sorted(told)) if told else "")


def extent(problem):
    """Size of a problem in words."""
    words = f"{len(problem.lines)} lines"
    words += f", {problem.duration:g} s" if problem.duration else ""
    return words + (f", {len(problem.draws)} draws" if len(problem.draws) else "")


def in_own_words(record):
    """The failure of a record, and the first complaint that the program printed."""
    return f"{record['failure']}" + (f" · {record['words']}" if record.get("words") else "")


def row(comparison, name):
    """Cells of a program: the settings that cost least at the target, or else those of the smallest error."""
    every = comparison.of(name)
    solved = [r for r in every if "error" in r]
    count, settings = runs.lines(name, comparison.work.task), comparison.chosen(name)
    if not solved:
        return [f"`{name}`", count, given(every[0]["settings"]), "fails", *["–"] * 6]
    if settings is None:
        settings = min(solved, key=lambda r: r["error"])["settings"]
    same = [r for r in solved if r["settings"] == settings]
    best = min(same, key=lambda r: r["cpu"])
    first = max(r["first_cpu"] for r in same)
    memory = min((r["peak_mb"] for r in same if r["peak_mb"] is not None), default=None)
    return [
        *(
            f"`{name}`",
            count,
            given(settings),
            f"{best['error']:.1e}",
            f"{best['tension_error']:.1e}" if "tension_error" in best else "–",
        ),
        *(f"{best['cpu']:.3g}", f"{first:.3g}", f"{min(r['wall'] for r in same):.3g}"),
        "–" if memory is None else f"{memory:.0f}",
        "1" if name == "refweb" else ratio(comparison, name),
    ]


def points(comparison, name):
    """CPU times and errors of a program, each of its settings once, by CPU time."""
    found = {}
    for r in comparison.of(name):
        if r.get("error", 0.0) > 0.0:
            key = given(r["settings"])
            found[key] = min(found.get(key, (np.inf, 0.0)), (r["cpu"], r["error"]))
    return sorted(found.values())


def drawn(comparisons):
    """Error over CPU time; dashed lines are those of the second work."""
    page, plot = plots.axes("CPU time [s]", "farthest node off [m]", height=4.4)
    marks = dict(zip(("refweb", *runs.ORDER), "osD^v<>PXh*", strict=True))
    colours = dict(zip(marks, (*plots.COLOURS, "#1f9e9e", "#d48fb0", "#7f6a3f", "#9aa83a", "#5b5bd6"), strict=True))
    for comparison, style in zip(comparisons, ("-", "--"), strict=False):
        second = f" ({comparison.work.name})" if style == "--" else ""
        for name in marks:
            if found := points(comparison, name):
                width = 2.2 if name == "refweb" else 1.2
                label = f"{name}{second}"
                plot.plot(
                    *zip(*found, strict=True), style, marker=marks[name], color=colours[name], lw=width, label=label
                )
    plot.set(xscale="log", yscale="log")
    page.legend(loc="outside right upper", frameon=False, fontsize=7)
    return page


def started(start):
    """Times of a first result."""
    rows = []
    for name, one in start.items():
        if "failure" in one:
            rows.append([f"`{name}`", f"fails: {one['failure']}", *["–"] * 4])
        else:
            total = one["venv"] + one["install"] + one["first"]
            rows.append([f"`{name}`", *(f"{one[key]:.1f}" for key in ("venv", "install", "first")), f"{total:.0f}",
                         f"{one['size_mb']:.0f}"])  # fmt: skip
    if not rows:
        return ""
    words = (
        "An empty environment, `pip install` without a cache, and one small run of the impact, of form finding for "
        "jax_fdm; what a program compiles is compiled. Wall time; the network is that of the machine."
    )
    heads = ["program", "environment [s]", "installation [s]", "first run [s]", "together [s]", "size [MB]"]
    return f"## To the first result\n\n{words}\n\n" + table(heads, rows)
