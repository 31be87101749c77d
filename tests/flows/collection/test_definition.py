"""A collection is read whole, and its errors named, before any work starts."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from flows.collection.definition import read_collection
from flows.wrong_use import WrongUse
from garden_models.scene import Target


def make_capture(folder: Path, photos: int = 3) -> Path:
    folder.mkdir(parents=True)
    for i in range(photos):
        Image.fromarray(np.full((60, 80, 3), 40 * i, np.uint8)).save(folder / f"{i}.png")
    return folder


@pytest.fixture
def home(tmp_path: Path) -> Path:
    for name in ("desk", "shelf"):
        make_capture(tmp_path / "captures" / name)
    return tmp_path


def write(home: Path, text: str, name: str = "night.toml") -> Path:
    path = home / name
    path.write_text(text)
    return path


def test_a_toml_file_gives_its_scenes(home: Path) -> None:
    (home / "quick.toml").write_text("[simulation]\nseconds = 2.0\n")
    path = write(
        home,
        """
        name = "flat"
        out = "packages"
        [settings]
        reconstruct.long_side = 320
        [[scene]]
        capture = "captures/desk"
        targets = [{ name = "mug", image = "0.png", box = [1, 2, 30, 40] }]
        [[scene]]
        capture = "captures/shelf"
        name = "board"
        preset = "quick.toml"
        settings = { "reconstruct.long_side" = 160 }
        """,
    )
    collection = read_collection(path)
    desk, board = collection.scenes
    assert (collection.name, collection.out) == ("flat", home / "packages")
    assert (desk.name, board.name) == ("desk", "board")
    assert desk.targets == (Target("mug", "0.png", (1.0, 2.0, 30.0, 40.0)),)
    assert desk.package == home / "packages" / "desk"
    assert desk.preset.reconstruct.long_side == 320
    assert board.preset.reconstruct.long_side == 160
    assert board.preset.simulation.seconds == 2.0


def test_a_yaml_file_says_the_same(home: Path) -> None:
    toml = write(home, '[[scene]]\ncapture = "captures/desk"\n')
    yaml = write(home, "scene:\n  - capture: captures/desk\n", "night.yaml")
    assert read_collection(toml).scenes == read_collection(yaml).scenes


def test_yaml_builds_no_objects(home: Path) -> None:
    path = write(home, "!!python/object/apply:os.system ['exit 3']", "night.yaml")
    with pytest.raises(WrongUse, match=r"night\.yaml"):
        read_collection(path)


@pytest.mark.parametrize(
    ("text", "mention"),
    [
        ('[[scene]]\ncapture = "captures/desk"\ntarget = "x"', "scene 1: unknown key `target`"),
        ('scenes = "here"', "unknown key `scenes`"),
        ('[[scene]]\nname = "desk"', "scene 1: `capture` is missing"),
        ('[[scene]]\ncapture = "captures/attic"', "scene 1: `capture`.*attic"),
        ('[[scene]]\ncapture = "captures/desk"\n' * 2, "scene 2: .*desk"),
        ('[[scene]]\ncapture = "captures/desk"\nname = "../desk"', "scene 1: `name`.*'../desk'"),
        ('[[scene]]\ncapture = "captures/desk"\ntargets = [{name = "mug"}]', "`targets`: .*mug"),
        ('[[scene]]\ncapture = "captures/desk"\ntargets = "t.json"', r"`targets`: .*t\.json"),
        ('[[scene]]\ncapture = "captures/desk"\nsettings = {mesh.x = 1}', "`settings`: .*option x"),
        ('preset = "fast"\n[[scene]]\ncapture = "captures/desk"', "`preset`: .*fast"),
        ('name = "../night"\n[[scene]]\ncapture = "captures/desk"', "`name`: '../night'"),
        ("[[scene]", "cannot be read"),
        ("", "no `scene`"),
    ],
)
def test_an_error_in_the_file_names_file_and_key(home: Path, text: str, mention: str) -> None:
    path = write(home, text)
    with pytest.raises(WrongUse, match=rf"(?s)night\.toml.*{mention}"):
        read_collection(path)


def test_a_capture_that_cannot_be_read_is_a_scene_that_failed(home: Path) -> None:
    make_capture(home / "captures" / "lone", photos=1)
    (home / "captures" / "shelf" / "1.png").write_bytes(b"no picture")
    path = write(
        home, "\n".join(f'[[scene]]\ncapture = "captures/{n}"' for n in ("lone", "shelf", "desk"))
    )
    collection = read_collection(path)
    assert [scene.name for scene in collection.scenes] == ["desk"]
    reasons = {scene.name: scene.reason for scene in collection.unreadable}
    assert "only one photo" in reasons["lone"]
    assert "1.png" in reasons["shelf"]


def test_a_box_outside_its_photo_fails_only_its_scene(home: Path) -> None:
    box = '{ name = "mug", image = "0.png", box = [1, 2, 300, 400] }'
    path = write(
        home,
        f'[[scene]]\ncapture = "captures/desk"\ntargets = [{box}]\n'
        '[[scene]]\ncapture = "captures/shelf"\n',
    )
    collection = read_collection(path)
    assert [scene.name for scene in collection.scenes] == ["shelf"]
    assert "mug" in collection.unreadable[0].reason


def test_a_folder_gives_its_captures_and_names_what_is_none(home: Path) -> None:
    captures = home / "captures"
    (captures / "notes").mkdir()
    (captures / "notes" / "read.me").write_text("nothing here")
    (captures / "walk.mp4").write_bytes(b"video")
    (captures / "clip").mkdir()
    (captures / "clip" / "IMG_1.MOV").write_bytes(b"video")
    collection = read_collection(captures, out=home / "out")
    assert collection.name == "captures"
    assert collection.names == ("clip", "desk", "shelf", "walk")
    assert [r for r in collection.remarks if "notes" in r and "skipped" in r]
    assert len(collection.remarks) == 1


def test_packages_among_the_captures_are_no_captures(home: Path) -> None:
    (home / "captures" / "out").mkdir()
    collection = read_collection(home / "captures", out=home / "captures" / "out")
    assert collection.names == ("desk", "shelf")
    assert collection.remarks == ()


def test_a_folder_without_captures_says_what_to_do(home: Path) -> None:
    with pytest.raises(WrongUse, match="factorize"):
        read_collection(home / "captures" / "desk")
    with pytest.raises(WrongUse, match="no such collection"):
        read_collection(home / "nowhere")


def test_a_scene_cannot_take_the_place_of_the_collections_own_files(home: Path) -> None:
    make_capture(home / "captures" / "collection.json")
    collection = read_collection(home / "captures", out=home / "out")
    assert collection.unreadable[0].name == "collection.json"
