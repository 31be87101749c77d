"""Run the maker from its folder: ``python tests/scenes/make_corner``."""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from make_corner.command import main  # type: ignore[import-not-found]

if __name__ == "__main__":
    sys.exit(main())
