"""The verbs of the command line, one file each; they know everything, and nothing knows them.

How to write a verb of the command line
---------------------------------------
A verb is a module that an entry point names. A whole file, ``my_webs/weigh.py``, which weighs the web of a scene,
``refweb weigh SCENE``::

    \"""Mass of a web.\"""

    from refweb.errors import InputError

    def add_arguments(parser):
        parser.add_argument("scene", metavar="SCENE", help="a scene file, or the name of a scene shipped with refweb")
        parser.add_argument("--per", type=float, default=1.0, metavar="KG", help="unit of mass (default: 1)")

    def run(arguments):
        from refweb.scene import Scene

        if not arguments.per > 0.0:
            raise InputError(f"--per = {arguments.per:g} must be > 0 [kg]")
        net = Scene.load(arguments.scene).build().net
        print(f"{net.cable_mass / arguments.per:.6g}")

The first sentence of its docstring is its line in ``refweb --help``. ``add_arguments`` gets its
`argparse.ArgumentParser`, and ``run`` what that parses. Results go to standard output. What ``run`` returns is the exit
status, 0 where that is None. What the user did wrong is an `refweb.InputError` of one line with the value, the limit
and the remedy, and leaves with status 2; a `refweb.SolverError`, an answer that is not found, with 1; an interruption,
also that of a batch queue, with 130. The message goes to the error stream; a verb catches none of them.

Help loads all verbs, so whatever is heavy, scenes and numpy among them, is imported inside functions.

``Scene.build()`` is what a scene comes to: ``net.cable_mass`` is that of the lines, ``net.mass`` that of each row, of
the ``net.nodes`` nodes with point masses first, then of bodies.

A verb that writes a result folder may have ``show(summary)``: ``refweb info`` calls it with the content of a
``run.json`` whose ``kind`` is the name of the verb.

The entry point of your package, whose verbs stand behind those of refweb, which are lines in
`refweb.registry.COMMANDS`::

    [project.entry-points."refweb.verbs"]
    weigh = "my_webs.weigh"
"""
