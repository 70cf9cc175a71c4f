"""Many runs of one scene: cases, workers, rows and chances; it knows the desk, and nothing of the command line.

A study says which values of a scene vary (`refweb.sweeps.study`); its cases follow from that alone
(`refweb.sweeps.design`). A case is a scene and nothing else: it is run wherever there is a worker
(`refweb.sweeps.case`, `refweb.sweeps.workers`), and what comes back is a row of ``results.csv``
(`refweb.results.case_rows`). A row is known by the content of its scene, so that a study that goes on, or one whose
parameters have changed, runs what is missing and nothing else (`refweb.sweeps.sweep`). `refweb.sweeps.chances`
evaluates all rows together, with spread and numerical ± apart.
"""
