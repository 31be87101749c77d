"""Pages about trainings: curves, tables, the gallery of augmentations."""

from __future__ import annotations

import numpy as np
import pytest

from flows.command import main
from flows.training.augmentation_page import write_gallery
from flows.training.pages import loss_chart, page, table
from flows.training.run import write_whole
from garden_models.disentanglement.training.augmentations.config import NAMES
from garden_models.disentanglement.training.picture import by_outcome, cloud_picture


def test_a_chart_of_any_length_can_be_drawn():
    for losses in (np.zeros(0), np.array([0.5]), np.linspace(0.7, 0.01, 500)):
        chart = loss_chart(losses)
        assert "nan" not in chart
    assert "step 500" in chart


def test_a_table_has_every_column_of_every_row():
    html = table([{"a": 1.0, "b": "<x>"}, {"a": 2.0, "c": 3}])
    assert html.count("<th>") == 3
    assert "&lt;x&gt;" in html
    assert table([]) == ""
    assert "<title>A &amp; B</title>" in page("A & B", [])


@pytest.mark.slow
def test_the_gallery_shows_every_augmentation_before_and_after(tmp_path):
    path = tmp_path / "gallery.html"
    write_gallery(path, "smoke", crops=1)
    html = path.read_text()
    for name in ("before", "all", *(n.replace("_", " ") for n in NAMES)):
        assert f"<figcaption>{name}</figcaption>" in html
    assert html.count("<img") == len(NAMES) + 2


def test_a_picture_shows_the_points_that_are_nearest():
    points = np.array([[0.0, 0.0, 0.0], [0.5, -0.5, 0.5]])
    colours = np.array([[255, 0, 0], [0, 0, 255]], np.uint8)
    box = np.array([[-1.0, -1, -1], [1, 1, 1]])
    picture = cloud_picture(points, colours, box, side=60)
    assert picture.shape == (60, 60, 3)
    drawn = {tuple(c) for c in picture.reshape(-1, 3)}
    assert len(drawn) >= 3


def test_outcomes_have_four_colours():
    claimed, truth = np.array([1, 1, 0, 0], bool), np.array([1, 0, 1, 0], bool)
    assert len({tuple(c) for c in by_outcome(claimed, truth)}) == 4


def test_a_file_is_written_whole_or_not_at_all(tmp_path):
    path = tmp_path / "new" / "file.bin"
    write_whole(path, b"one")
    write_whole(path, b"two")
    assert path.read_bytes() == b"two"
    assert [p.name for p in path.parent.iterdir()] == ["file.bin"]


def test_wrong_use_is_told(capsys):
    with pytest.raises(SystemExit) as stopped:
        main(["train", "nothing"])
    assert stopped.value.code == 2
    assert "point-classifier" in capsys.readouterr().err
