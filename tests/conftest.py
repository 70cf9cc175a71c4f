"""Processes that tests start run the code under test, from whatever folder: not what is installed beside it.

They compile without a second process: the workers of the tests fill the cores.
"""

import os
import pathlib

_before = os.environ.get("PYTHONPATH")
os.environ["PYTHONPATH"] = os.pathsep.join([str(pathlib.Path(__file__).parents[1]), *([_before] if _before else [])])
os.environ.setdefault("REFWEB_COMPILERS", "1")
