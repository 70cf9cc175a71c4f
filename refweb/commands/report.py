"""Write one page of a result folder: results, plots, pictures, and the web in space to turn and play."""

import pathlib

from ..errors import InputError


def add_arguments(parser):
    """The folder, where the page goes, and how much of the motion is on it."""
    parser.add_argument("folder", metavar="DIR")
    parser.add_argument(
        "--out", metavar="FILE", help="page to write, HTML that needs nothing else (default: DIR/report.html)"
    )
    text = "frames to turn and play (default: as many as keep the page below some 3 MB)"
    parser.add_argument("--frames", type=int, metavar="N", help=text)


def run(arguments):
    """Write it, and print where it is."""
    from ..pages import page, study
    from ..results.folder import read_summary
    from ..results.progress import followed

    if (read_summary(pathlib.Path(arguments.folder)) or {}).get("kind") == "sweep":
        if arguments.frames is not None:
            raise InputError(f"--frames {arguments.frames} has no meaning for a study, which has none: leave it out")
        print(study.report(arguments.folder, out=arguments.out))
        return
    with followed(True, "drawing") as tell:
        path = page.report(arguments.folder, out=arguments.out, frames=arguments.frames, progress=tell)
    print(path)
