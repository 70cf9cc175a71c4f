"""Findings of load steps: each kind once, with the load steps at which it was found.

May change: words of texts, in so far as no test quotes them. Must stay: codes of findings, which stand in
`findings.CODES` and ``run.json``; `Remarks`, `open_rows`, `remark_on_open` and `on_stability`, which
`dynamics.simulation` and `studies` call as well; `remarks_on`, which `simulation` imports. Tests:
``tests/test_findings.py``, ``tests/results/test_remarks.py``.
"""

from __future__ import annotations

import numpy as np

from ..findings import NOTE, Finding
from ..results.observables.balances import lost_by_path
from ..results.state import curve_remark, floor_remark, strain_remark, strain_remarks_of_thread
from ..results.strength import strength_remark


class Remarks:
    """Findings of load steps, by kind."""

    def __init__(self):
        self._made, self._steps = {}, 0

    def record(self, step, findings):
        """Take the findings of a load step."""
        self._steps += 1
        for finding in findings:
            self._made.setdefault(finding.code, []).append((step, finding))

    def renew(self, step, code, findings):
        """Replace the findings of one code at a load step."""
        made = [entry for entry in self._made.pop(code, []) if entry[0] != step]
        made += [(step, finding) for finding in findings]
        if made:
            self._made[code] = made

    def findings(self):
        """The last finding of each code, with its load steps unless it was found at all of them."""
        for made in self._made.values():
            steps = ", ".join(f"{step:g}" for step, _ in made[:8]) + (", ..." if len(made) > 8 else "")
            at = f" (load step {steps})" if len(made) < self._steps else ""
            yield made[-1][1]._replace(text=made[-1][1].text + at)


def open_rows(state, equilibrium):
    """Nodes whose position an equilibrium leaves open: those that float, else those that only slack lines hold."""
    return state.slack_nodes if equilibrium.floating is None else equilibrium.floating.rows


def remark_on_open(state, equilibrium):
    """Find positions that an equilibrium leaves open, of bodies and of nodes."""
    net, open_ = state.system.net, open_rows(state, equilibrium)
    loose = []
    for body in net.bodies:
        if moves := [move for row, move in ((body.row, "move"), (body.spin, "turn")) if row in open_]:
            loose.append(f'body "{body.name}" can {" and ".join(moves)} at no cost')
    if loose:
        yield Finding("loose-bodies", f"{'; '.join(loose)}: place and orientation are not unique there", "body")
    open_ = open_[open_ < net.nodes]
    if not len(open_):
        return
    some = ", ".join(map(str, open_[:4])) + (", ..." if len(open_) > 4 else "")
    how = "are in parts that only slack lines hold"
    if np.isin(open_, state.slack_nodes).all():
        how = "hang on slack lines only"
    elif equilibrium.floating.parts is None:
        how = "can move at no cost"
    yield Finding("loose-nodes", f"{len(open_)} nodes {how}, their positions are not unique: {some}")


def on_stability(state, equilibrium, subject="the equilibrium"):
    """Findings on the stability of an equilibrium, and on other equilibria."""
    stability = equilibrium.stability
    if stability is None:
        return
    if stability.sign == -1:
        yield Finding("unstable", f"{subject} is a saddle ({stability.why}): {_way_out(state, stability)}")
        return
    if stability.sign is None:
        yield Finding("stability-in-doubt", f"whether {subject} is stable is not decided: {stability.why}")
    pushing, above = "bars" if _bars_push(state) else "slack lines", equilibrium.stats.get("above_lowest", 0.0)
    others = "there may be other equilibria, and lower ones, which ± does not know"
    text = ""
    if equilibrium.may_turn_over:
        pull = (state.element_tension[state.system.net.law_is("bar")] >= 0.0).all()
        lowest = equilibrium.stats.get("above_lowest") == 0.0
        others = "there may be other equilibria, none of them lower" if lowest else others
        text = f"{'bars can' if pull else 'bars'} push: {others}"
    elif above is None:
        text = f"{pushing} push: {others}"
    elif equilibrium.stats.get("unsure"):
        text = f"{pushing} push: another state may be lower by up to {above:.3g} J, which ± does not know"
    if text:
        yield Finding("lowest-in-doubt", text)


def _way_out(state, stability):
    """Consequence of a saddle, and the remedy."""
    system = state.system
    deflect = "start from a web that is deflected"
    if stability.gyroscopic:
        return (
            "the web would leave this state by itself as soon as anything damps its motion in these axes; until then "
            f"Coriolis forces hold it; {deflect}"
        )
    if system.rotating or not (state.element_tension < 0.0).any():
        return f"the web would leave this state by itself; {deflect}"
    law = "bars" if _bars_push(state) else "slack lines under the law's floor"
    reason = f"{law} push, and the web would wrinkle or buckle out of this state; "
    return reason + ('law = "tension-only" has no such states' if system.dead else deflect)


def remarks_on(state, stats, utilisation, equilibrium):
    """Findings on an equilibrium."""
    net = state.system.net
    yield from floor_remark(net, float(state.stress.max()))
    yield from on_stability(state, equilibrium)
    yield from remark_on_open(state, equilibrium)
    yield from _not_proven(state, equilibrium)
    if state.system.contact_shares is not None:
        from .contact_kinks import sharing_remark

        yield from sharing_remark(state, equilibrium.stability)
    yield from _other_rests(state)
    if starts := equilibrium.stats.get("starts"):
        apart = max(starts) - min(starts)
        if apart > 1e-9 * max(map(abs, starts)):
            yield Finding(
                "two-equilibria",
                f"two starts lead to two equilibria, {apart:.3g} J apart: this is the lower one, a third may be "
                'lower still; law = "tension-only" has no such states',
            )
    yield from strength_remark(utilisation)
    strain = np.where(net.forming, -np.inf, state.element_strain)
    yield from strain_remark(net, (float(strain.max()), int(net.line[strain.argmax()])))
    if (scale := net.curve_scale) is not None:
        shares = state.element_strain * scale
        yield from curve_remark(net, float(shares.max()), int(shares.argmax()))
    for thread in net.threads:
        yield from strain_remarks_of_thread(thread, float(state.threads[thread.name][2]))
    yield from collapse_remark(state)


def _other_rests(state):
    """Find bodies on axles that rest on lines or bodies: they may also rest beyond these."""
    under = {wrap.body for thread in state.system.net.threads for wrap in thread.wraps}
    for body in state.system.resting:
        if body.pivot is not None and body.name not in under and state.reaction[body.row].any():
            text = f'body "{body.name}" rests by contact, and its axle lets it rest elsewhere as well, as hanging free'
            text += ": this is the rest that is reached downhill from the start; start elsewhere for another one"
            yield Finding("other-rests", text, "body")


def _not_proven(state, equilibrium):
    """A finding where lines that yield, one line, or a free body keeps the errors of dead loads from being proven."""
    net = state.system.net
    proven = net.law_is("convex") & ~(net.forming & (net.line_data.ea <= 0.0))
    if state.system.resting and proven.all():
        name = state.system.resting[0].name
        text = f'body "{name}" is free: ± are estimates, as the proven bound asks for a web without free bodies'
        yield Finding("not-proven", text, "body")
    if net.wound and proven.all():
        text = "lines are on a winch: ± are estimates for these load steps, no proven bounds, and a winch that turns "
        text += "round between two of them is not seen; compare with more load_steps"
        yield Finding("not-proven", text, "winch")
    elif any(thread.rings for thread in net.threads) and proven.all():
        text = "threads have friction or a winch: ± are estimates for these load steps, no proven bounds, and a thread "
        text += "that slips over a ring and turns back between two of them is not seen; compare with more load_steps"
        yield Finding("not-proven", text, "thread")
    elif net.threads and proven.all() and equilibrium.duality_bound is None:
        text = f'thread "{net.threads[0].name}": ± are estimates, as the proven bound asks for threads with law = '
        yield Finding("not-proven", text + '"tension-only" that run over no body, dead loads and no contact', "thread")
    if net.law_is("plastic").any():
        unseen = "a line that yields and turns back between two load steps is not seen; compare with more load_steps"
        start = 'lines can yield (law = "elastic-plastic"): ±'
        if equilibrium.duality_bound is not None:
            text = f"{start} are proven for loading in which no line turns back, and none has so far; {unseen}"
            yield Finding("monotone-loading", text, severity=NOTE)
            return
        why = "as the proven bound asks for dead loads, constant natural lengths, and lines that do not turn back and"
        if lost_by_path(state):
            unseen += ", as well for plastic_energy and total_energy, which have no ±: they depend on the load steps"
        yield Finding("not-proven", f"{start} are estimates, {why} harden where they yield; {unseen}")
        return
    if not state.system.dead or proven.all() or not (proven.any() or net.forming.any()):
        return
    first = proven.argmin()
    law, how = net.laws[net.law_index[first]], "can push"
    if law.name == "constant-force":
        how = "has a force that does not depend on its length"
    yield Finding(
        "not-proven",
        f'line {net.line[first]} {how} (law = "{law.name}"): ± are estimates, as the proven bound asks for law = '
        '"tension-only", or a force density above 0, on all lines',
    )


def _bars_push(state):
    """Tell if a line of the linear law pushes, or all lines have that law."""
    bars = state.system.net.law_is("bar") | state.system.net.forming
    return bool((bars & (state.element_tension < 0.0)).any() or bars.all())


def collapse_remark(state):
    """Find a net that has collapsed because its lines do not push.

    A net has collapsed if a node has moved farther than the size of the web, beyond the displacements of [[motion]],
    while all strains are below 1. The size is the diagonal of the box around the web, and what reels pay out.
    """
    system, net = state.system, state.system.net
    if net.law_is("bar").all() or net.forming.any():
        return
    moved, points = np.linalg.norm(state.x[: net.nodes], axis=1), net.points[: net.nodes]
    driven = np.concatenate([[], *(drive.cells[:, 0] for drive in system.drives)]).astype(int)
    driven = driven[driven < net.nodes]
    far, size = float(moved.max() - moved[driven].max(initial=0.0)), float(np.linalg.norm(np.ptp(points, axis=0)))
    longer = system.natural_length(state.time) - net.line_data.natural_length
    if far > size + np.maximum(longer, 0.0).sum() and state.strain.max() < 1.0:
        yield Finding(
            "collapse",
            f"the web collapses: node {int(moved.argmax())} moves by {moved.max():.4g} m, and the whole web measures "
            f"{size:.4g} m; lines that do not push cannot keep the shape of what nothing holds: add supports or lines",
        )
