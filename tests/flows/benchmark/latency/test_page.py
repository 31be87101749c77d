"""The page and the Markdown: open alone, show every step, and cannot be broken by a name."""

from __future__ import annotations

import re
from html.parser import HTMLParser
from xml.etree import ElementTree

import pytest

from flows.benchmark.latency.document import Measured, latency_document
from flows.benchmark.latency.machine import Machine, this_machine
from flows.benchmark.latency.markdown import latency_markdown
from flows.benchmark.latency.page import latency_page
from flows.benchmark.latency.tables import scene_table, seconds
from flows.benchmark.latency.timeline import LEFT, RIGHT, WIDTH, step_colours, timeline
from flows.benchmark.latency.timing import SceneTiming, StepTiming
from tasks.step import Seconds

VOID = {"meta", "link", "br"}
NASTY = "a<b>|\"'&c"


def step(name: str, target: str, start: float, host: str = "here", **parts: float) -> StepTiming:
    cost = Seconds(**parts)
    began = start + cost.wait
    ended = start + cost.total
    return StepTiming(NASTY, target, name, "cold", 1, cost, None, began, ended, 50.0, host=host)


@pytest.fixture
def scene() -> SceneTiming:
    steps = (
        step("register", "", 100.0, load=2.0, compute=6.0, publish=2.0),
        step("segment", "mug <1>", 110.0, compute=20.0),
        step("segment", "jar", 110.0, wait=10.0, compute=20.0),
        step("compose", "", 500.0, compute=10.0),  # a second run, much later
        step("render", "", 510.0, compute=10.0),
    )
    return SceneTiming(NASTY, "cold", 1, ("mug <1>", "jar"), steps, wall_s=99.0)


@pytest.fixture
def measured(scene: SceneTiming) -> Measured:
    absent = ("warm & <all> its seconds",)
    return Measured((scene,), "Made up.", Machine("here", "CPU X", 2, 8.0), absent)


class Balanced(HTMLParser):
    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.outside: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if tag not in VOID:
            self.open.append(tag)
        self.outside += [v or "" for k, v in attrs if k in ("src", "href") and v != "data:,"]

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        pass

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


def test_the_page_is_well_formed_and_needs_nothing_else(measured: Measured) -> None:
    page = latency_page(latency_document(measured), measured)
    checked = Balanced()
    checked.feed(page)
    assert checked.open == [] and checked.outside == []
    assert "url(" not in page and "<script" not in page
    assert NASTY not in page and "a&lt;b&gt;" in page
    assert "prefers-color-scheme: dark" in page
    for words in ("CPU X", "RTX A6000", "BoardRoom-CUED", "warm &amp; &lt;all&gt;", "every step"):
        assert words in page


def test_a_timeline_has_a_lane_a_target_and_a_bar_with_a_title_a_step(scene: SceneTiming) -> None:
    figure = ElementTree.fromstring(timeline(scene, step_colours(scene.steps)))
    bars = [g for g in figure.iter("g") if "bar" in g.get("class", "")]
    assert len(bars) == len(scene.steps)
    titles = [bar.findtext("title") or "" for bar in bars]
    assert any(t.startswith("segment[jar]: 30.00 s (wait 10.00, compute 20.00)") for t in titles)
    heights = {title: bar.find("rect").get("y") for title, bar in zip(titles, bars, strict=True)}  # type: ignore[union-attr]
    assert len(set(heights.values())) == 3  # the scene, the mug, the jar
    assert [bar.get("class") for bar in bars].count("bar left-out") == 1


def test_bars_are_as_long_as_their_seconds_and_gaps_are_cut_out(scene: SceneTiming) -> None:
    """60 seconds in which a step went on: 10, 30 (two side by side), 10 and 10."""
    figure = ElementTree.fromstring(timeline(scene, step_colours(scene.steps)))
    inner = WIDTH - LEFT - RIGHT
    parts = {
        (bar.findtext("title") or "").split(":")[0]: [
            (float(r.get("x", 0)), float(r.get("width", 0))) for r in bar.findall("rect")
        ]
        for bar in figure.iter("g")
    }
    widths = {name: sum(w for _, w in rects) / inner * 60 for name, rects in parts.items()}
    assert widths["register"] == pytest.approx(10, abs=0.01)
    assert widths["segment[jar]"] == pytest.approx(30, abs=0.01)
    assert widths["render"] == pytest.approx(10, abs=0.01)
    starts = {name: (rects[0][0] - LEFT) / inner * 60 for name, rects in parts.items()}
    assert starts["compose"] == pytest.approx(40, abs=0.01)
    assert starts["render"] == pytest.approx(50, abs=0.01)
    loads = [w / inner * 60 for _, w in parts["register"]]
    assert loads == pytest.approx([2, 6, 2], abs=0.01)


def test_markdown_tables_have_one_cell_a_column_whatever_the_names(measured: Measured) -> None:
    text = latency_markdown(latency_document(measured))
    tables = re.findall(r"(?:^\|.*\n)+", text, flags=re.MULTILINE)
    assert len(tables) == 5
    for table in tables:
        counts = {len(re.findall(r"(?<!\\)\|", line)) for line in table.splitlines()}
        assert len(counts) == 1


def test_columns_that_nothing_is_known_of_are_left_out(measured: Measured) -> None:
    header = scene_table(latency_document(measured)).header
    assert "cold p50" in header and "cold wall" in header
    assert not any(name.startswith(("warm", "cached")) for name in header)


def test_hardware_of_another_machine_is_not_claimed(scene: SceneTiming) -> None:
    away = SceneTiming("desk", "cold", 1, (), (step("register", "", 1.0, host="far", compute=1.0),))
    here = Machine("here", "CPU X", 2, 8.0)
    text = latency_markdown(latency_document(Measured((scene, away), "Made up.", here)))
    assert "of far only the name is known" in text
    alone = latency_markdown(latency_document(Measured((scene,), "Made up.", here)))
    assert "only the name is known" not in alone


def test_the_machine_is_read_from_the_kernel(tmp_path) -> None:  # type: ignore[no-untyped-def]
    (tmp_path / "cpuinfo").write_text("processor\t: 0\nmodel name\t: Fast CPU @ 3: GHz\n\n" * 2)
    (tmp_path / "meminfo").write_text("MemTotal:       16000000 kB\nMemFree: 1 kB\n")
    machine = this_machine(tmp_path)
    assert machine.cpu == "Fast CPU @ 3: GHz" and machine.memory_gb == 16.4
    assert machine.gpus == () and machine.cores >= 1
    assert this_machine(tmp_path / "nothing").cpu == "unknown CPU"


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (None, "–"),
        (0.0, "0.000"),
        (0.00042, "0.00042"),
        (0.05, "0.050"),
        (2.5, "2.50"),
        (472.4, "472"),
    ],
)
def test_seconds_keep_the_digits_that_count(value: float | None, text: str) -> None:
    assert seconds(value) == text
