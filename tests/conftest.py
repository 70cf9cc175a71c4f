"""Processes that tests start run the code under test, from whatever folder: not what is installed beside it."""

import os
import pathlib

_before = os.environ.get("PYTHONPATH")
os.environ["PYTHONPATH"] = os.pathsep.join([str(pathlib.Path(__file__).parents[1]), *([_before] if _before else [])])
