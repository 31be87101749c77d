"""Every invariant that ``INVARIANTS.md`` states is held by tests, and those exist."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import storage

ROOT = Path(storage.__file__).parent.parent
NAMES = {
    "SEALED", "SELF-NAMING", "NO-DANGLING", "WRITE-ONCE", "SAME-AS-COLD", "HIT-MEANS-VERIFIED",
    "EARLY-CUTOFF", "LOCKS-DIE-WITH-OWNERS", "ORPHANS-ONLY", "CATALOG-IS-DERIVED", "FAIL-LOUD",
    "EXPLAINED",
}  # fmt: skip


def stated() -> dict[str, list[str]]:
    text = (ROOT / "storage" / "INVARIANTS.md").read_text()
    sections = re.split(r"^### ", text, flags=re.MULTILINE)[1:]
    return {s.split("\n")[0]: re.findall(r"^- `(.*)`$", s, flags=re.MULTILINE) for s in sections}


def test_all_twelve_are_stated_and_each_is_held() -> None:
    assert stated().keys() == NAMES
    assert all(stated().values())


def test_the_tests_that_hold_them_exist() -> None:
    for tests in stated().values():
        for test in tests:
            file, _, name = test.partition("::")
            tree = ast.parse((ROOT / file).read_text())
            defined = {n.name for n in tree.body if isinstance(n, ast.FunctionDef | ast.ClassDef)}
            assert name in defined, test
