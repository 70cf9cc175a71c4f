"""Draw a result folder."""

from ..errors import InputError


def add_arguments(parser):
    """The folder, what is drawn of it, and where."""
    parser.add_argument("folder", metavar="DIR")
    parser.add_argument("--frame", type=int, metavar="N", help="number of the frame (default: the last)")
    parser.add_argument("--field", metavar="NAME", help="what the colours show (default: stress)")
    parser.add_argument("--out", metavar="FILE", help="picture to write (default: DIR/web.png)")
    parser.add_argument("--animate", action="store_true", help="all frames as a GIF (default: DIR/web.gif)")


def run(arguments):
    """Draw, and print where the picture is."""
    from ..pictures.pictures import animate, picture
    from ..results.progress import followed

    if arguments.animate:
        if arguments.frame is not None:
            raise InputError(f"--frame {arguments.frame} and --animate exclude each other: leave one out")
        with followed(True, "drawing") as tell:
            path = animate(arguments.folder, field=arguments.field, out=arguments.out, progress=tell)
    else:
        with followed(True, "drawing"):
            path = picture(arguments.folder, frame=arguments.frame, field=arguments.field, out=arguments.out)
    print(path)
