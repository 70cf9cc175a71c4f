"""The training of the guide "Learning to control", whole: its learning curve, and its CPU time.

    python -m validation.cost.learning [ITERATIONS]

runs the files of ``refweb help learning`` in a temporary folder, by default for 20 iterations, which takes some 90 s of
CPU time, and writes ``validation/pictures/learning-curve.png``.
"""

from __future__ import annotations

import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile

import refweb.reference

PAGE = pathlib.Path(refweb.reference.__file__).parent / "site" / "pages" / "learning.md"
PICTURE = pathlib.Path(__file__).parents[1] / "pictures" / "learning-curve.png"
ITERATIONS = "20"


def main(iterations=ITERATIONS, picture=PICTURE):
    """Train, copy the picture, and print the CPU time."""
    blocks = re.findall(r'^```python title="([^"]+)"\n(.*?)^```$', PAGE.read_text(encoding="utf-8"), re.M | re.S)
    with tempfile.TemporaryDirectory() as folder:
        for name, text in blocks:
            pathlib.Path(folder, name).write_text(text, encoding="utf-8")
        subprocess.run([sys.executable, "train.py", iterations], cwd=folder, check=True)
        shutil.copy(pathlib.Path(folder, "learning-curve.png"), picture)
    used = os.times()
    print(f"{used.children_user + used.children_system:.0f} s of CPU time; curve in {picture}")
    return 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
