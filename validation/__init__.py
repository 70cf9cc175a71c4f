"""What refweb is worth: its results beside closed forms, published figures and independent methods.

    python -m validation [--quick] [--list] [NAMES]

runs the cases of `validation.harness.case.CASES`, all or those named, and writes ``validation/report/index.html`` (one
page that holds all of its figures) and ``report.md``; the exit status is 1 where a row or a verdict fails.
``tests/test_validation.py`` runs every case with ``--quick``. How to write a case says `validation.harness.case`.
``cost.explicit``, ``cost.implicit``, ``cost.statics``, ``cost.gradients``, ``cost.start``, ``cost.effects``,
``cost.environments``, ``methods.refinement`` and ``paper.fundamental_frequencies`` print tables of their own with
``python -m validation.cost.explicit`` and so on; ``cost.learning`` trains a policy and draws its learning curve.
`validation.recipes` has short scripts to copy.
"""
