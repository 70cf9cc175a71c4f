"""Write one page of a result folder: results, plots, pictures, and the web in space to turn and play."""

# This docstring is the help of the verb. May change: texts. Must stay: `add_arguments` and `run`, which
# `refweb.__main__` calls; names of options. This file says which options exclude each other, `pages` checks their
# values. Tests: tests/pages/test_page.py, tests/pages/test_sheet.py.

import pathlib

from ..errors import InputError


def add_arguments(parser):
    """Declare the folder, the file and the number of frames."""
    parser.add_argument("folder", metavar="DIR")
    parser.add_argument(
        "--out", metavar="FILE", help="page to write, HTML that needs nothing else (default: DIR/report.html)"
    )
    text = "the sheet alone, one page: sizes, largest tension, margin of safety and the worth of each result (default "
    parser.add_argument("--sheet", action="store_true", help=text + "file: DIR/sheet.html)")
    text = "of the packed volume on the sheet, the share that is cable, > 0 and ≤ 1 (default: 0.5)"
    parser.add_argument("--packing", type=float, metavar="SHARE", help=text)
    text = "frames to turn and play (default: as many as keep the page below some 3 MB)"
    parser.add_argument("--frames", type=int, metavar="N", help=text)


def run(arguments):
    """Write the page, and print its path."""
    from ..pages import page, study
    from ..results.folder import read_summary
    from ..results.progress import followed

    if (read_summary(pathlib.Path(arguments.folder)) or {}).get("kind") == "sweep":
        if arguments.frames is not None:
            raise InputError(f"--frames {arguments.frames} has no meaning for a study, which has none: leave it out")
        if arguments.sheet:
            raise InputError(
                f"--sheet is of one run, and {arguments.folder} holds a study of many: leave it out, or run one "
                "case of the study by refweb run SCENE --set PATH=VALUE"
            )
        print(study.report(arguments.folder, out=arguments.out))
        return
    if arguments.packing is not None and not arguments.sheet:
        raise InputError(f"--packing {arguments.packing:g} has a meaning with --sheet alone: give both")
    if arguments.sheet:
        if arguments.frames is not None:
            raise InputError(f"--frames {arguments.frames} has no meaning with --sheet, which shows none: leave it out")
        packing = {} if arguments.packing is None else {"packing": arguments.packing}
        print(page.sheet(arguments.folder, out=arguments.out, **packing))
        return
    with followed(True, "drawing") as tell:
        path = page.report(arguments.folder, out=arguments.out, frames=arguments.frames, progress=tell)
    print(path)
