"""One page of a result folder: results, plots, pictures, and the web in space to turn and play."""


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
    from ..pages.page import report
    from ..results.progress import followed

    with followed(True, "drawing") as tell:
        path = report(arguments.folder, out=arguments.out, frames=arguments.frames, progress=tell)
    print(path)
