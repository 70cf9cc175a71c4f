"""Many runs of one scene: cases, workers, rows and statistics; it knows scenes and runs, and no command line.

A study names the values of a scene that vary (`refweb.sweeps.study`). Its cases follow from that alone
(`refweb.sweeps.design`). A case is a scene, which any worker may run (`refweb.sweeps.case`, `refweb.sweeps.workers`).
Its result is a row of ``results.csv`` (`refweb.results.case_rows`). The key of a row is a digest of its scene: a study
that continues, or whose parameters have changed, runs only the missing cases (`refweb.sweeps.sweep`).
`refweb.sweeps.chances` computes statistics of all rows, with spread and numerical ± apart.

This file has no code. Must stay: its first sentence, which ``tests/test_architecture.py`` compares.
"""
