"""Say which scenes a collection has, from a TOML or YAML file or a folder of captures."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from flows.licence import Licence
from flows.preset import PRESETS, Preset
from flows.proposal_options import ProposalOptions
from flows.scene_request import SceneOptions, read_scene
from flows.scene_run import SceneRequest
from flows.wrong_use import WrongUse
from garden_models.scene import BadInput
from garden_models.targets.boxes import check_name
from storage.formats.errors import UnreadableInput

SCENES = Path("scenes")
RESERVED = ("collection.json", "collection.html", "failed.json")
"""Files of the collection itself, beside the scenes' folders."""


@dataclass(frozen=True)
class UnreadableScene:
    """A scene whose capture cannot be read: it has failed before any work, and why."""

    name: str
    reason: str


@dataclass(frozen=True)
class Collection:
    """Scenes that are run together; their packages go to ``out``.

    ``source`` is the file or folder it was read from. ``unreadable`` scenes belong to it
    too. ``remarks`` tell what was left out.
    """

    name: str
    scenes: tuple[SceneRequest, ...]
    out: Path
    source: str
    unreadable: tuple[UnreadableScene, ...] = ()
    remarks: tuple[str, ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """The names of all scenes, sorted."""
        return tuple(sorted([s.name for s in self.scenes] + [s.name for s in self.unreadable]))


def read_collection(
    path: Path,
    *,
    out: Path | None = None,
    preset: Preset | None = None,
    force: frozenset[str] = frozenset(),
    licence: Licence = "any",
    proposal: ProposalOptions = ProposalOptions(),
) -> Collection:
    """Read a collection and look at every capture, before any work starts.

    Args:
        path: a TOML or YAML file, or a folder whose sub-folders and videos are captures.
        out: where packages go; the file's ``out`` or ``scenes`` if not given.
        preset: the options of all steps; the file's if not given.
        force: steps that run even if cached, in every scene.
        licence: which models' licences are accepted, in every scene.
        proposal: who proposes targets where the collection gives a scene none.

    Raises:
        WrongUse, BadInput: the file has an error, or the folder no capture in it.
    """
    if path.is_dir():
        from flows.collection.capture_folder import read_folder

        entries, remarks = read_folder(path, out or SCENES, preset or PRESETS["embedded"])
        name, out = check_name(path.resolve().name, "collection"), out or SCENES
    elif path.is_file():
        from flows.collection.collection_file import read_file

        file = read_file(path, out, preset)
        entries, remarks, name, out = file.entries, (), file.name, file.out
    else:
        raise WrongUse(
            f"no such collection: {path}; give a TOML or YAML file or a folder of captures"
        )
    scenes, unreadable = _look_at(entries, force, licence, proposal)
    return Collection(name, scenes, out, str(path), unreadable, remarks)


def _look_at(
    entries: Iterable[tuple[str, SceneOptions]],
    force: frozenset[str],
    licence: Licence,
    proposal: ProposalOptions,
) -> tuple[tuple[SceneRequest, ...], tuple[UnreadableScene, ...]]:
    """Return the scenes that can be run, and those of which only the reason is known."""
    scenes, unreadable = [], []
    for name, options in entries:
        try:
            if name in RESERVED:
                raise BadInput(f"a scene cannot be called {name}, like a file of the collection")
            asked = dataclasses.replace(options, name=name, force=force, licence=licence)
            scenes.append(read_scene(proposal.applied(asked)))
        except (WrongUse, BadInput, UnreadableInput, OSError) as error:
            unreadable.append(UnreadableScene(name, str(error)))
    return tuple(scenes), tuple(unreadable)
