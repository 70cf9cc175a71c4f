"""Build a wheel with machine code: ``python -m refweb.compiled.wheel FOLDER`` after ``refweb warm --ship``.

It needs a clone, and the packages `build` and `wheel`. Machine code is for one minor version of Python and one
platform, which are in the name of the wheel; with another version of numba refweb compiles as usual.

May change: the message. Must stay: how it is called, since ``.github/workflows/wheels.yml`` does so, and the exit
status; tags of a wheel are as narrow as its machine code: one minor version of Python, one platform. No test runs it.
"""

from __future__ import annotations

import pathlib
import subprocess
import sys
import sysconfig

from .store import SHIPPED


def main(folder):
    """Build the wheel into a folder; returns the exit status."""
    if not any(SHIPPED.glob("*")):
        print(f"no machine code in {SHIPPED}: run `python -m refweb warm --ship` first", file=sys.stderr)
        return 2
    version = f"cp{sys.version_info.major}{sys.version_info.minor}"
    tag = sysconfig.get_platform().replace("-", "_").replace(".", "_")
    tag = tag.replace("linux_", "manylinux_2_17_") if tag.startswith("linux_") else tag
    subprocess.run([sys.executable, "-m", "build", "--wheel", "--outdir", folder], check=True)
    built = sorted(pathlib.Path(folder).glob("refweb-*-py3-none-any.whl"))[-1]
    named = "--remove", "--python-tag", version, "--abi-tag", version, "--platform-tag", tag
    subprocess.run([sys.executable, "-m", "wheel", "tags", *named, str(built)], check=True)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1] if len(sys.argv) > 1 else "dist"))
