"""Compute how results and frequencies change with numbers of a scene: gradients, in statics by line as a picture."""

# This docstring is the help of the verb. May change: texts and `SHOWN`. Must stay: `add_arguments` and `run`, which
# `refweb.__main__` calls; names of options; keys of `--json`, which are for scripts. `Solution.gradient` computes.
# Tests: tests/statics/test_gradients.py, tests/dynamics/test_dynamic_gradients.py.

from ..errors import InputError
from .arguments import add_json, add_scene, print_json, scene_of

SHOWN = 20
"""Largest number of lines in a table: those of the largest derivatives."""


def add_arguments(parser):
    """Declare the scene, the result, and the numbers by which it is differentiated."""
    add_scene(parser)
    parser.add_argument(
        "--of", metavar="RESULT", help="name of a result, or frequency_1 and so on (default: the first of the scene)"
    )
    text = "a number of the scene, as cable.area or load.0.force.2, in statics also force or position, of each node; "
    text += "repeatable (default: all, by line cable.area)"
    parser.add_argument("--path", dest="paths", action="append", metavar="PATH", help=text)
    text = "in statics by each line or group, of cable.modulus, cable.area, cable.density, cable.prestrain or "
    text += "natural_length"
    parser.add_argument("--by", choices=["line", "group"], help=text)
    text = "a picture of the web to write, with the lines coloured by the gradient by line of the first PATH"
    parser.add_argument("--picture", metavar="FILE", help=text)
    add_json(parser)


def run(arguments):
    """Solve the scene, and print or draw the gradients."""
    from ..results.progress import followed
    from ..statics.gradients import numbers_of

    scene = scene_of(arguments)
    names = [o.name for o in scene.observables]
    result = names[0] if arguments.of is None else arguments.of
    number = _mode(result, names)
    moves = scene.solve.kind == "dynamic" and number is None
    if moves and (arguments.by or arguments.picture):
        raise InputError('gradients by line or group, and their picture, need [solve] kind = "static"')
    paths = arguments.paths or (["cable.area"] if arguments.by else numbers_of(scene.to_dict()))
    if arguments.picture:
        from ..pictures.pictures import target

        target(arguments.picture)
    with followed(not arguments.json) as tell:
        solution = _solved(scene, number, tell)
    gradients, refused = [], []
    if moves:
        paths, refused = _followed(solution, result, paths, bool(arguments.paths))
    for path in paths:
        try:
            gradients.append(solution.gradient(result, path, arguments.by))
        except InputError as error:
            known = result in names or number is not None
            if arguments.paths or arguments.by or not known or str(error).startswith("gradient"):
                raise
            if not str(error).startswith(f"{path} = 0 cannot be changed"):  # as what has no meaning in statics
                refused.append(f"{path}: {error}")
    if arguments.picture:
        _draw(solution, result, arguments.paths[0] if arguments.paths else "cable.area", arguments.picture)
    if arguments.json:
        print_json([_plain(gradient) for gradient in gradients])
        return
    from .console import print_gradients

    print_gradients(solution, result, gradients, refused, SHOWN)
    if arguments.picture:
        print(arguments.picture)


def _mode(result, names):
    """Number of the mode whose natural frequency a result is; None of another one."""
    from ..studies.frequency_gradients import NAME

    match = None if result in names else NAME.fullmatch(result)
    return None if match is None else int(match[1])


def _solved(scene, number, tell):
    """The modes of a scene up to one behind a number; its run where there is no number."""
    if number is None:
        from ..runner import run

        return run(scene, progress=tell)
    from ..studies.modes import MAX_MODES, modes

    if number >= MAX_MODES:
        raise InputError(f"frequency_{number} must be at most frequency_{MAX_MODES - 1}")
    return modes(scene, number + 1, progress=tell)


def _followed(solution, result, paths, asked):
    """(Paths with gradients in dynamics, texts of those without), from one pass; refuses a path that is asked for."""
    from ..dynamics.parameters import FIXED

    refused = {}
    if not asked:
        paths = [path for path in paths if path.partition(".")[0] not in FIXED]
    solution.gradients.refuse(result)
    solution.gradients.follow(paths, None if asked else refused)
    texts = [text for path, text in refused.items() if not text.startswith(f"{path} = 0 cannot be changed")]
    return [path for path in paths if path not in refused], texts


def _draw(solution, result, path, out):
    """Draw the web with its lines coloured by the gradient."""
    import pathlib

    import numpy as np

    from ..pictures.over_frames import with_values
    from ..pictures.pictures import drawn, record_of
    from ..results.files import write_atomically

    values, net, record = solution.gradient(result, path, "line").value, solution.state.system.net, record_of(solution)
    count = len(record.frame(max(record.times)).paths)
    record = with_values(record, "gradient", values if count == len(values) else values[net.line])
    title = f"{record.title}: gradient of {result} by {path} of each line [{solution.results[result].unit}, SI]"
    record = record._replace(summary={**record.summary, "scene": title})
    limits = [float(values.min()), float(values.max())] if np.ptp(values) > 0.0 else None
    page = drawn(record, -1, field="gradient", range=limits)
    write_atomically(pathlib.Path(out), lambda name: page.savefig(name, dpi="figure"))


def _plain(gradient):
    """A gradient as a dict of plain values."""
    keys = ("result", "path", "by", "names", "value", "error", "left", "unit", "equal", "notes")
    values = {key: getattr(gradient, key) for key in keys}
    values = {key: value.tolist() if hasattr(value, "tolist") else value for key, value in values.items()}
    return {key: list(value) if isinstance(value, tuple) else value for key, value in values.items()}
