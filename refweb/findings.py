"""Findings: remarks, warnings and refusals of a run, each with a code that programs can ask for.

May change: meanings in `CODES`, which are words of the reference, to be written anew (CONTRIBUTING). Must stay: codes,
severities and fields of `Finding`, which stand in ``run.json`` and are read back; programs of users ask for them. A new
code needs a row in `CODES` and a `Finding` that has it, and a row whose code nothing uses has to go:
``tests/test_findings.py``. Must stay as well: all names that `runner`, `commands.console` and other files import.
"""

from __future__ import annotations

from typing import NamedTuple

NOTE, WARNING, REFUSAL = "note", "warning", "refusal"
"""Severities: what a run has done by itself, what limits its results, and why it has none."""
CODES = {
    "balance-drift": "Energy or momentum does not follow from what acts.",
    "beyond-curve": "A strain beyond the last point of the curve of a law.",
    "body-not-felt": "A body and no contact: the web does not feel it.",
    "breaks-in-doubt": "Breaks within ± of each other, or in another order in the step-refinement run.",
    "chaotic": "Differences grow exponentially within the run.",
    "coincident-nodes": "Nodes of a thread that come together.",
    "collapse": "Lines that do not push have let the web collapse.",
    "deep-contact": "A contact is deeper than is allowed of a body.",
    "digits-not-reached": "The digits asked for are not reached.",
    "drum-moves": "A drum or ring that is free to move, of a winch whose mass follows: angular momentum is not kept.",
    "event-not-seen": "A threshold is passed and passed back within a step.",
    "flies-past": "A body whose straight path does not meet the web.",
    "half-turn": "An end of a thread about half a turn round a cylinder from where it was, where turns are lost.",
    "idle-load": "Something acts on supports alone and moves nothing.",
    "integration": "A method of dynamics cannot finish.",
    "kink": "Elements between slack and taut, of which no vibration is linear.",
    "large-strain": "A strain beyond what the law describes.",
    "law-floor": "The smooth law lets slack lines push.",
    "left-out": "Effects and bodies that a solution leaves out, such as friction in statics.",
    "lines-in-doubt": "Lines may have passed through lines.",
    "loose-bodies": "Bodies that the equilibrium leaves free to move or turn.",
    "loose-nodes": "Positions that the equilibrium leaves open.",
    "lowest-in-doubt": "Other equilibria may be lower.",
    "material": "Values of the cable that its material gives, which are typical ones.",
    "mesh-file": "Lines of a file that lie on each other, or nodes that coincide.",
    "method-changed": 'Method = "auto" goes on with another method.',
    "monotone-loading": "± of statics is proven for lines that yield and do not turn back.",
    "moved-at-start": "Nodes or natural lengths that are elsewhere at the start than they were.",
    "never-touched": "A body with contact that nothing touches.",
    "no-error": "± of results is not known.",
    "no-stiffness": "Directions without stiffness, which have no frequency.",
    "no-support": "Parts that no support holds along an axis.",
    "not-proven": "± of statics is an estimate and no proven bound.",
    "other-rests": "Bodies on axles that may rest elsewhere as well.",
    "over-strength": "A line is stressed above its strength, or may be within ±.",
    "passage-in-doubt": "Lines may have passed through bodies.",
    "push-along-lines": "Contact pushes a body along lines, to which ± is blind.",
    "repeated": "A run was repeated with other settings.",
    "resumed": "A run goes on with other versions of libraries.",
    "shared-push": "Elements of a line that are as near to a sphere share its push.",
    "short-window": "A mean whose window was not full at the end.",
    "slow-library": "A library that makes the run fast is not there.",
    "soft-contact": "A contact is so deep that results may move with its stiffness.",
    "solver": "A solver has found no answer.",
    "stability-in-doubt": "The stability of the equilibrium is not decided.",
    "starts-around": "The web begins around a body.",
    "starts-in-body": "A body that starts inside of the web, or the web in a body.",
    "starts-open": "A net whose mouth is open at the start of a throw.",
    "surface": "Repairs of the surface of a body, or an error of it that ± does not contain.",
    "switch-in-doubt": "A control that switches may switch otherwise within ±.",
    "tables": "Breakpoints of tables shorten the steps.",
    "two-equilibria": "Two starts lead to two equilibria.",
    "undetected-overlap": "Bodies in each other that do not touch each other.",
    "unit-in-doubt": "A number that may be meant in another unit.",
    "unstable": "The equilibrium is a saddle.",
    "wide-error": "± of a peak is above a tenth of it.",
}
"""Meaning of each code."""


class Finding(NamedTuple):
    """A remark, a warning or a refusal.

    Attributes
    ----------
    code : str
        One of `CODES`.
    text : str
        Text for the reader.
    table : str
        Name of the table of the scene that it is about; empty for none.
    severity : {"warning", "note", "refusal"}
        Severity.
    """

    code: str
    text: str
    table: str = ""
    severity: str = WARNING


def texts(findings):
    """Texts of all findings but refusals, which the message of a run has."""
    return [finding.text for finding in findings if finding.severity != REFUSAL]


def read_findings(summary):
    """Findings of the content of ``run.json``; of a folder that has warnings alone, these without a code."""
    if "findings" in summary:
        return [Finding(**entry) for entry in summary["findings"]]
    return [Finding("", text) for text in summary["warnings"]]
