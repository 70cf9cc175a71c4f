"""Features of a run: kernels for features that it has not are neither compiled nor loaded.

May change: how a feature is counted. Must stay: each name in ``apart`` of a kernel of the loop is a key here, and
counts above 0 in every run that may call that kernel: a run ends where it calls one whose feature is missing. A new
name stands in the list of the docstring as well; `of_balances`, which `simpson_balance` imports. Tests:
``tests/test_pay_for_what_you_call.py``, by which a run has no kernel that it does not need.
"""

from __future__ import annotations


def of_balances(turns, outside):
    """Names of those that balances of energy and momentum ask for, a set: ``turning`` and ``angular``."""
    return {name for name, counted in (("turning", turns.moment), ("angular", outside.axes)) if len(counted)}


def features(scheme, model, observed, events):
    """Names of what a run has and not every run has: kernels for what it has not are not compiled.

    Returns
    -------
    set of str
        ``stages`` or ``kicks`` (steps of one drift); ``watched`` (extremes), ``books`` (of energies), ``averages``,
        ``looks`` (any of these), ``events``; ``turning`` bodies and ``carried`` nodes; ``driven`` rows, ``sliding``
        material, ``jumping`` velocities of either; ``lengths`` that change, masses that ``follows`` them, their
        ``growth``, ``relaxing`` internal variables;
        ``powers``, ``snaps`` of forces that jump, ``viscous`` forces, ``rubbing``; ``pushing`` and ``damped``
        (integrated impulses),
        ``booked`` (powers, lengths or pushing), ``angular`` momentum that is kept; ``near`` cells, ``pairs`` that are
        found; collision checks (``ccd``) of lines that push each other (``line_ccd``) and of bodies that push lines
        (``body_ccd``); ``contacts`` of bodies.
    """
    inertia, terms, outside, windows = model.inertia, model.terms, model.outside, observed.windows
    driven = len(inertia.driven) + len(model.motions.kernels) + (model.lengths.growth >= 0)
    has = {
        "stages": len(scheme.drifts) > 1,
        "kicks": len(scheme.drifts) == 1,
        "watched": len(observed.followed) + len(observed.sums),
        "books": len(observed.sums),
        "averages": len(windows.slots),
        "looks": len(observed.followed) + len(observed.sums) + len(windows.slots),
        "events": len(events),
        "carried": len(inertia.turns.carried),
        "driven": driven,
        "sliding": len(model.lengths.masses.sliding),
        "jumping": driven + len(model.lengths.masses.sliding),
        "lengths": len(model.lengths.elements),
        "follows": len(model.lengths.masses.rows),
        "growth": model.lengths.growth >= 0,
        "relaxing": len(model.relaxing.terms),
        "powers": len(terms.powers),
        "snaps": (terms.powers[:, 2] > 1).sum(),
        "viscous": len(terms.viscous),
        "rubbing": len(model.implicit_contacts.terms),
        "pushing": len(outside.pushing),
        "damped": len(outside.damped),
        "booked": len(terms.powers) + len(model.lengths.elements) + len(outside.pushing),
        "near": len(model.nearby.terms),
        "pairs": len(model.nearby.at),
        "ccd": len(model.ccd.checks),
        "line_ccd": model.ccd.touch,
        "body_ccd": model.ccd.bodies,
        "contacts": len(model.contacts.terms),
    }
    return {name for name, count in has.items() if count} | of_balances(inertia.turns, outside)
