"""Arguments that several verbs have."""


def add_scene(parser):
    """The scene to work on."""
    parser.add_argument("scene", metavar="SCENE", help="a scene file, or the name of a scene shipped with refweb")


def add_force(parser):
    """Leave to replace results."""
    parser.add_argument("--force", action="store_true", help="replace the results of an earlier run in DIR")
