"""What the benchmark writes: lines that say whether a claim holds, a page, a document."""

from __future__ import annotations

import json
from pathlib import Path

from flows.benchmark.measure import Measure
from flows.benchmark.orchestration.report import BenchmarkReport, Section

ROWS = [{"system": "ours", "ms": 0.25, "server ms": None}, {"system": "b", "ms": 2, "server ms": 1}]


def report(*values: float) -> BenchmarkReport:
    claims = tuple(Measure(f"claim {v:g}", v, 3.0, "%") for v in values)
    return BenchmarkReport([Section("A step", "How it was measured.", ROWS, claims)])


def test_it_holds_only_if_every_claim_does() -> None:
    assert report().holds
    assert report(1, 2).holds
    assert not report(1, 4).holds


def test_text_has_the_table_and_a_line_a_claim() -> None:
    text = report(1, 4).to_text()
    assert "system  ms    server ms" in text
    assert "ours    0.25  -" in text
    ok, miss = text.splitlines()[-2:]
    assert ok.startswith("ok") and "claim 1" in ok and "<= 3 %" in ok
    assert miss.startswith("MISS") and "claim 4" in miss


def test_both_files_are_written(tmp_path: Path) -> None:
    report(1, 4).write(tmp_path / "new")
    document = json.loads((tmp_path / "new" / "orchestration.json").read_text())
    assert document["holds"] is False
    (section,) = document["sections"]
    assert section["rows"] == ROWS
    assert [claim["holds"] for claim in section["claims"]] == [True, False]
    assert document["machine"]["cores"]
    page = (tmp_path / "new" / "orchestration.md").read_text()
    assert "## A step" in page
    table = [line for line in page.splitlines() if line.startswith("|")]
    assert len(table) == 4
    assert {line.count("|") for line in table} == {4}
