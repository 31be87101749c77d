"""Read a collection's file, TOML or YAML; every path in it is relative to the file.

    name = "flat"
    out = "scenes"
    preset = "embedded"

    [settings]
    reconstruct.long_side = 640

    [[scene]]
    capture = "captures/desk"
    targets = [{ name = "mug", image = "IMG_0012.jpg", box = [480, 300, 760, 690] }]

A scene may also have ``name``, ``cameras``, ``preset`` and ``settings``, and a file as
``targets``. What is not known is an error, so that a misspelt key is not ignored.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from flows.capture import capture_name
from flows.preset import PRESETS, Preset, named_preset, with_settings
from flows.scene_request import SceneOptions
from flows.wrong_use import WrongUse
from garden_models.scene import BadInput, Target
from garden_models.targets.boxes import check_name, parse_targets

FILE_KEYS = ("name", "out", "preset", "settings", "scene")
SCENE_KEYS = ("capture", "name", "targets", "cameras", "preset", "settings")


@dataclass(frozen=True)
class CollectionFile:
    """What a file says, checked; no capture has been looked at."""

    name: str
    out: Path
    entries: list[tuple[str, SceneOptions]]


def read_file(path: Path, out: Path | None, preset: Preset | None) -> CollectionFile:
    """Read the file; ``out`` and ``preset`` go before what it says.

    Raises WrongUse for the first error, with the file and the key.
    """
    table = _Table(_parse(path), str(path), FILE_KEYS)
    name = table.checked("name", table.text("name") or path.stem, "collection")
    folder = path.parent
    place = out or folder / (table.text("out") or "scenes")
    base = preset or table.preset(PRESETS["embedded"], folder)
    entries: dict[str, SceneOptions] = {}
    for index, scene in enumerate(table.tables("scene"), start=1):
        options = _scene(_Table(scene, f"{path}: scene {index}", SCENE_KEYS), folder, place, base)
        called = options.name or ""
        if called in entries:
            raise WrongUse(
                f"{path}: scene {index}: there is a scene called {called} already: give each a"
                " `name` of its own"
            )
        entries[called] = options
    if not entries:
        raise WrongUse(f"{path} has no `scene`: give at least one, with its `capture`")
    return CollectionFile(name, place, list(entries.items()))


def _scene(table: _Table, folder: Path, out: Path, preset: Preset) -> SceneOptions:
    capture = table.existing("capture", folder)
    if capture is None:
        raise WrongUse(f"{table.where}: `capture` is missing: give a folder, video or file")
    name = table.checked("name", table.text("name") or capture_name(capture), "scene")
    return SceneOptions(
        capture=capture,
        out=out,
        preset=table.preset(preset, folder),
        name=name,
        cameras=table.existing("cameras", folder),
        targets=table.targets(folder),
    )


def _parse(path: Path) -> object:
    try:
        text = path.read_text("utf-8")
        if path.suffix.lower() == ".toml":
            return tomllib.loads(text)
        if path.suffix.lower() in (".yaml", ".yml"):
            return _from_yaml(text)
    except (UnicodeDecodeError, ValueError) as error:
        raise WrongUse(f"{path} cannot be read: {error}") from error
    raise WrongUse(f"{path} is no collection: give a .toml or .yaml file or a folder of captures")


def _from_yaml(text: str) -> object:
    import yaml  # type: ignore[import-untyped]

    try:
        return yaml.safe_load(text)
    except yaml.YAMLError as error:
        raise ValueError(str(error)) from error


class _Table:
    """A table of the file, whose keys are known; ``where`` begins its errors."""

    def __init__(self, document: object, where: str, known: tuple[str, ...]) -> None:
        if not isinstance(document, dict):
            raise WrongUse(f"{where} must be a table with the keys {', '.join(known)}")
        for key in document:
            if key not in known:
                raise WrongUse(f"{where}: unknown key `{key}`: there are {', '.join(known)}")
        self._values: dict[str, Any] = document
        self.where = where

    def text(self, key: str) -> str | None:
        """Return a text, None if there is none."""
        value = self._values.get(key)
        if value is None or (isinstance(value, str) and value):
            return value
        raise WrongUse(f"{self.where}: `{key}` must be a text, got {value!r}")

    def checked(self, key: str, name: str, what: str) -> str:
        """Return a name that is safe as a folder's."""
        try:
            return check_name(name, what)
        except BadInput as error:
            raise WrongUse(f"{self.where}: `{key}`: {error}") from error

    def existing(self, key: str, folder: Path) -> Path | None:
        """Return the path of something that is there, None if none is given."""
        given = self.text(key)
        if given is None:
            return None
        path = folder / Path(given).expanduser()
        if not path.exists():
            raise WrongUse(f"{self.where}: `{key}`: no such file or folder: {path}")
        return path

    def tables(self, key: str) -> list[Any]:
        """Return a list of tables."""
        value = self._values.get(key, [])
        if not isinstance(value, list):
            raise WrongUse(f"{self.where}: `{key}` must be a list of tables")
        return value

    def preset(self, base: Preset, folder: Path) -> Preset:
        """Return the preset that the table names (``base`` if none), with its settings."""
        named, settings = self.text("preset"), self._values.get("settings", {})
        if not isinstance(settings, Mapping):
            raise WrongUse(f"{self.where}: `settings` must be a table: STEP.OPTION = VALUE")
        key = "preset"
        try:
            chosen = base if named is None else named_preset(named, folder)
            key = "settings"
            return with_settings(chosen, {str(k): value for k, value in settings.items()})
        except BadInput as error:
            raise WrongUse(f"{self.where}: `{key}`: {error}") from error

    def targets(self, folder: Path) -> Path | tuple[Target, ...] | None:
        """Return the targets: a file's path, or those given here."""
        value = self._values.get("targets")
        if value is None or isinstance(value, str):
            return self.existing("targets", folder)
        try:
            return parse_targets({"targets": value})
        except BadInput as error:
            raise WrongUse(f"{self.where}: `targets`: {error}") from error
