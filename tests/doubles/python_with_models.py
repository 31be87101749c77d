"""Be a Python in which the paper's models are installed: PYTHON this.py LONG_SIDE WORDS...

As ``python`` in the model settings it takes what a Python takes there: a script with its words,
or ``-c`` and a program.
"""

from __future__ import annotations

import runpy
import sys
from pathlib import Path


def main() -> None:
    """Install the doubles, and run what is asked for."""
    here = Path(__file__).resolve()
    sys.path[0] = str(here.parents[2])
    from tests.doubles.published_code import install_packages

    long_side = int(sys.argv[1])
    sys.argv[:] = sys.argv[2:]
    install_packages(long_side)
    if sys.argv[0] == "-c":
        program = sys.argv.pop(1)
        exec(program, {"__name__": "__main__"})
    else:
        runpy.run_path(sys.argv[0], run_name="__main__")


if __name__ == "__main__":
    main()
