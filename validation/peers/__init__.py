"""refweb beside its peers: the same problems, given to other programs as their users would write them.

    python -m validation.peers [PEERS] [--work WORKS] [--python PATH] [--out FOLDER] [--quick | --full]

measures, and writes a page with tables and a picture; ``--text validation/PEERS.md`` writes the page of the
documentation. ``python -m pip install -e ".[peers]"`` brings the peers that have wheels; one that is not installed, or
does not run, is left out with its reason.

A peer is a file of `validation.peers.programs` with ``version()``, ``COMPILES``, which is True where it compiles when
it is called, and a function for each task, which takes a `validation.peers.problem.Problem` and settings and returns
positions of nodes; its name stands in `validation.peers.runs.ORDER`. A work is a file of `validation.peers.work`.
"""
