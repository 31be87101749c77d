"""The page shows the worst scenes first, and nothing a name holds becomes markup."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from flows.collection.overview import seconds_left
from flows.collection.page import collection_page, write_page
from flows.collection.row import SceneRow
from flows.collection.state import CollectionState
from flows.report.pictures import data_uri


def state(out: Path, *rows: SceneRow) -> CollectionState:
    return CollectionState("night", "night.toml", "store", out, {row.name: row for row in rows})


def test_the_worst_come_first(tmp_path: Path) -> None:
    rows = [
        SceneRow("a", "ok"), SceneRow("b", "degraded"), SceneRow("c", "failed"),
        SceneRow("d", "waiting"), SceneRow("e", "failed"),
    ]  # fmt: skip
    page = collection_page(state(tmp_path, *rows))
    places = {name: page.index(f"<h2>{name} ") for name in "abcde"}
    assert sorted(places, key=lambda name: places[name]) == ["c", "e", "d", "b", "a"]


def test_what_comes_from_outside_is_text(tmp_path: Path) -> None:
    row = SceneRow("<b>x", "failed", ['<script>alert("x")</script>'], package='"><b>x')
    page = collection_page(state(tmp_path, row))
    assert "<script" not in page
    assert "<b>x" not in page


def test_a_scene_shows_its_photo_and_its_settled_render(tmp_path: Path) -> None:
    (tmp_path / "desk").mkdir()
    pictures = {
        "photo a.jpg": 40, "render of a.jpg as composed": 90, "render of a.jpg after 10 s": 140
    }  # fmt: skip
    (tmp_path / "desk" / "report.html").write_text(
        "".join(
            f'<img src="{data_uri(np.full((300, 400, 3), grey, np.uint8))}" alt="{alt}">'
            for alt, grey in pictures.items()
        )
    )
    page = collection_page(state(tmp_path, SceneRow("desk", "ok", package="desk")))
    assert page.count("<img") == 2
    assert 'alt="photo a.jpg"' in page
    assert 'alt="render of a.jpg after 10 s"' in page
    assert 'href="desk/report.html"' in page


def test_the_page_needs_no_network(tmp_path: Path) -> None:
    write_page(state(tmp_path, SceneRow("desk", "ok", step_seconds={"register": 3.0})))
    page = (tmp_path / "collection.html").read_text()
    assert "http://" not in page
    assert "https://" not in page
    assert "register 3.0 s" in page


def test_the_time_left_comes_from_the_scenes_that_had_work(tmp_path: Path) -> None:
    done = SceneRow("a", "ok", executed=3, seconds=100.0, finished=2000.0)
    found = SceneRow("b", "ok", cached=3)
    runs = SceneRow("c", "running", started=1970.0)
    known = state(tmp_path, done, found, runs, SceneRow("d"), SceneRow("e"))
    known.started, known.scenes_at_once = 1000.0, 2
    assert seconds_left(known, now=2000.0) == (70.0 + 100.0 + 100.0) / 2
    known.rows.pop("a")
    assert seconds_left(known, now=2000.0) is None
