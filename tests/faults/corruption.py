"""Damage every kind of artifact in every way; see that it is found, made again, never served.

    python -m tests.faults.corruption [--full] [--flips N] [--seed N]

prints how many damages were tried on each kind, how many were found on read and on look-up
and mended by the step, and which were not; exit code 1 if any was not. By default one damage
in twenty, chosen by the seed; with ``--full`` all files of all kinds, with N flipped bits each.
"""

from __future__ import annotations

import argparse
import dataclasses
import random
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from garden_models.scene import Capture, Photo
from storage import CorruptArtifact, MissingArtifact, Store
from storage.actions import action_name, latest_name
from storage.bucket import object_prefix
from storage.codec.tree import encode
from tasks.step import Ref, RunContext, load, run_context, step
from tests.faults.damage import Damage, damages_of_file, damages_of_object
from tests.faults.part import Count, part
from tests.storage.media import behind
from tests.storage.samples import same
from tests.tasks.step.test_nouns_stored import NOUNS, build

SCENE = "room"
LARGE = "Capture of several chunks"
SAMPLES = [*(noun.__name__ for noun in NOUNS), LARGE]
_BY_NAME = {noun.__name__: noun for noun in NOUNS} | {LARGE: Capture}


def value_of(name: str) -> Any:
    """Return the sample of this name; the same at every call."""
    if name != LARGE:
        return build(_BY_NAME[name], 2)
    noise = np.random.default_rng(0).integers(0, 256, (3, 700, 900, 3), dtype=np.uint8)
    return Capture(tuple(Photo(f"{i}.jpg", rgb, (900, 700)) for i, rgb in enumerate(noise)))


@step(version=1, retries=0)
def sample(name: str) -> Any:
    """Return a sample of a noun."""
    return value_of(name)


@dataclass
class Trial:
    """What became of one damage. ``wrong`` says what must not be."""

    sample: str
    damage: Damage
    found_on_read: bool = False
    made_again: bool = False
    wrong: list[str] = field(default_factory=list)


class Bench:
    """One sample in a store: damage it and look what happens."""

    def __init__(self, address: str | Path, name: str) -> None:
        self._address = str(address)
        self._stores = 0
        self.name = name
        self.noun = _BY_NAME[name]
        self.value = value_of(name)
        self.first = self.make()[0]

    @property
    def store(self) -> Store:
        """The store, opened anew: nothing is remembered from before the damage."""
        return Store.open(f"{self._address}-{self._stores}", durability="none")

    def make(self) -> tuple[Ref, Any, list[str]]:
        """Run the step; return its reference, the value read through it, and what was done."""
        with run_context(RunContext(self.store, SCENE)) as context:
            ref = sample(self.name, label=self.name)
            value = load(ref, self.noun)
        return ref, value, [event.outcome or "" for event in context.outcomes]

    def damages(self, flips: int, chance: random.Random) -> Iterator[Damage]:
        """Give every damage to the object and to the records that lead to it."""
        there = behind(self.store)
        yield from damages_of_object(there, self.object_name, flips, chance)
        for name in self.records:
            yield from damages_of_file(there, name, flips, chance)

    @property
    def object_name(self) -> str:
        """How the names of the object's files begin."""
        return object_prefix(self.first.object).rstrip("/")

    @property
    def records(self) -> tuple[str, str]:
        """The names of the action record and of the pointer to it."""
        return action_name(self.first.key), latest_name(SCENE, "sample", self.name)

    def try_damage(self, damage: Damage) -> Trial:
        """Damage the store, read, look up and mend; the store is whole again afterwards."""
        trial = Trial(self.name, damage)
        damage.do(behind(self.store))
        in_object = damage.name.startswith(self.object_name)
        self._read(trial, in_object)
        if in_object:
            self._read_parts(trial)
        self._mend(trial, in_object or damage.name == self.records[0])
        return trial

    def _read(self, trial: Trial, in_object: bool) -> None:
        try:
            value = self.store.read(self.first.object, self.noun)
        except (CorruptArtifact, MissingArtifact):
            trial.found_on_read = True
            if not in_object:
                trial.wrong.append("a whole artifact was not read")
            return
        if in_object:
            trial.wrong.append("it was read as if it were whole")
        if not same(value, self.value):
            trial.wrong.append("a wrong value was read")

    def _read_parts(self, trial: Trial) -> None:
        """Read field by field and array by array: each is right, or not served."""
        for spec in dataclasses.fields(self.noun):
            try:
                found = self.store.read_fields(self.first.object, self.noun, (spec.name,))
            except (CorruptArtifact, MissingArtifact):
                continue
            if not same(found[spec.name], getattr(self.value, spec.name)):
                trial.wrong.append(f"a wrong field {spec.name} was read")
        for path, leaf in encode(self.value).leaves.items():
            if isinstance(leaf, np.ndarray) and leaf.ndim:
                self._read_slice(trial, path, leaf)

    def _read_slice(self, trial: Trial, path: str, leaf: np.ndarray) -> None:
        try:
            array, place = self.store.read_array(self.first.object, path)
            start = place[0] if len(place) == 2 else 0
            found = array[place[0]][:1] if len(place) == 1 else array[start : start + 1]
        except (CorruptArtifact, MissingArtifact, ValueError, RuntimeError):
            return  # Zarr's own checksum, in the last two cases
        if not np.array_equal(found, leaf[:1]):
            trial.wrong.append(f"a wrong slice of {path} was read")

    def _mend(self, trial: Trial, needs_mending: bool) -> None:
        try:
            ref, value, did = self.make()
        except Exception as error:  # noqa: BLE001 - whatever it is, the user's step failed
            trial.wrong.append(f"the step failed: {error!r}")
            self._restore()
            return
        trial.made_again = "executed" in did
        if needs_mending and did.count("executed") != 1:
            trial.wrong.append("it was not made again")
        if not same(value, self.value):
            trial.wrong.append("a wrong value was served")
        if not needs_mending and trial.made_again:
            trial.wrong.append("it was made again for nothing")
        told = (ref.object, ref.content, ref.kind, ref.status, ref.reasons, ref.key)
        first = self.first
        if told != (first.object, first.content, first.kind, first.status, first.reasons, ref.key):
            trial.wrong.append(f"the reference says something else: {told}")
        if problems := self.store.verify("full"):
            trial.wrong.append(f"damage stayed in the store: {problems[0]}")
        if trial.wrong:
            self._restore()

    def _restore(self) -> None:
        """Go on with a new store where this one did not mend itself."""
        self._stores += 1
        self.first = self.make()[0]


def trials(
    folder: Path, *, flips: int, seed: int, share: float, names: list[str] | None = None
) -> Iterator[Trial]:
    """Try a share of all damages on all samples."""
    chance = random.Random(seed)
    for name in names or SAMPLES:
        bench = Bench(folder / name.replace(" ", "-"), name)
        for damage in list(bench.damages(flips, chance)):
            if chance.random() < share:
                yield bench.try_damage(damage)


@part("corruption")
def whole(folder: Path) -> Iterator[Count]:
    """Try every damage on every sample, for ``make faults``."""
    for name in SAMPLES:
        found = list(trials(folder, flips=8, seed=0, share=1.0, names=[name]))
        wrong = tuple(f"{t.damage}: {'; '.join(t.wrong)}" for t in found if t.wrong)
        yield Count(f"damages of {name}", len(found), wrong)


def report(found: list[Trial]) -> str:
    """Return the table of what was tried and found."""
    lines = [f"{'artifact':<28}{'damages':>9}{'found on read':>15}{'made again':>12}{'wrong':>7}"]
    for name in dict.fromkeys(trial.sample for trial in found):
        of_it = [trial for trial in found if trial.sample == name]
        lines.append(_line(name, of_it))
    lines.append(_line("all", found))
    kinds = Counter(trial.damage.kind for trial in found)
    lines.append(", ".join(f"{kind} {count}" for kind, count in sorted(kinds.items())))
    wrong = [trial for trial in found if trial.wrong]
    lines += [f"WRONG {t.sample}: {t.damage}: {'; '.join(t.wrong)}" for t in wrong[:50]]
    return "\n".join(lines)


def _line(name: str, found: list[Trial]) -> str:
    read = sum(trial.found_on_read for trial in found)
    again = sum(trial.made_again for trial in found)
    wrong = sum(bool(trial.wrong) for trial in found)
    return f"{name:<28}{len(found):>9}{read:>15}{again:>12}{wrong:>7}"


def main() -> int:
    """Run from the command line; return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--full", action="store_true", help="all damages, not one in twenty")
    parser.add_argument("--flips", type=int, default=8, help="flipped bits a file")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="garden-") as folder:
        share = 1.0 if options.full else 0.05
        found = list(trials(Path(folder), flips=options.flips, seed=options.seed, share=share))
    print(report(found))
    return int(any(trial.wrong for trial in found))


if __name__ == "__main__":
    sys.exit(main())
