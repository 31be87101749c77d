"""Any damage to any kind of artifact is found on read or look-up, and made again; never served.

``python -m tests.faults.corruption --full`` tries all of it and prints counts.
"""

from __future__ import annotations

import random
import uuid
from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from storage.members import MemberReader
from tests.faults.corruption import LARGE, SAMPLES, Bench, Trial, report, trials
from tests.faults.damage import Damage
from tests.s3_server import BUCKET
from tests.storage.media import behind
from tests.tasks.step.test_nouns_stored import NOUNS


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Bench]:
    """Give the bench of a sample; one store each, mended after every damage."""
    folder = tmp_path_factory.mktemp("corruption")
    made: dict[str, Bench] = {}

    def give(name: str) -> Bench:
        if name not in made:
            made[name] = Bench(folder / uuid.uuid4().hex, name)
        return made[name]

    return give


def file_of(bench: Bench, data: st.DataObject) -> str:
    names = behind(bench.store).names(bench.object_name)
    return data.draw(st.sampled_from(names), label="file")


def check(trial: Trial) -> None:
    assert trial.wrong == []
    assert trial.found_on_read
    assert trial.made_again


def test_every_noun_that_steps_publish_is_tried() -> None:
    assert {noun.__name__ for noun in NOUNS} < set(SAMPLES)
    assert len(NOUNS) >= 13


@settings(max_examples=60, deadline=None, derandomize=True)
@given(data=st.data(), name=st.sampled_from(SAMPLES))
def test_hit_means_verified_any_flipped_bit_is_found_and_mended(
    bench: Callable[[str], Bench], data: st.DataObject, name: str
) -> None:
    """In any member, or the manifest, of any kind of artifact."""
    tried = bench(name)
    file = file_of(tried, data)
    size = len(behind(tried.store).get(file))
    bit = data.draw(st.integers(0, 8 * size - 1), label="bit")
    check(tried.try_damage(Damage("flip", file, bit)))


@settings(max_examples=40, deadline=None, derandomize=True)
@given(data=st.data(), name=st.sampled_from(SAMPLES))
def test_hit_means_verified_any_cut_or_lost_file_is_found_and_mended(
    bench: Callable[[str], Bench], data: st.DataObject, name: str
) -> None:
    tried = bench(name)
    file = file_of(tried, data)
    size = len(behind(tried.store).get(file))
    damage = data.draw(
        st.integers(0, size - 1).map(lambda left: Damage("cut", file, left))
        | st.just(Damage("missing", file))
        | st.just(Damage("longer", file))
        | st.just(Damage("extra", f"{tried.object_name}/extra")),
        label="damage",
    )
    check(tried.try_damage(damage))


@pytest.mark.parametrize("name", ["Placement", LARGE])
def test_a_lost_object_is_made_again(bench: Callable[[str], Bench], name: str) -> None:
    tried = bench(name)
    check(tried.try_damage(Damage("lost", tried.object_name)))


@pytest.mark.parametrize("damage", ["cut", "empty", "missing"])
@pytest.mark.parametrize("which", [0, 1], ids=["action record", "pointer to the newest"])
def test_a_record_that_cannot_be_read_counts_for_nothing(
    bench: Callable[[str], Bench], damage: str, which: int
) -> None:
    tried = bench("Placement")
    name = tried.records[which]
    half = len(behind(tried.store).get(name)) // 2
    trial = tried.try_damage(Damage(damage, name, half))  # type: ignore[arg-type]
    assert trial.wrong == []
    assert trial.made_again == (which == 0)


def test_any_flipped_bit_of_an_action_record_is_found_and_mended(
    bench: Callable[[str], Bench],
) -> None:
    """Also where it stays readable: another verdict, content or name would be served."""
    tried = bench("Placement")
    chance = random.Random(0)
    wrong = []
    for _ in range(60):
        name = tried.records[0]
        bit = chance.randrange(8 * len(behind(tried.store).get(name)))
        trial = tried.try_damage(Damage("flip", name, bit))
        wrong += trial.wrong
    assert wrong == []


def test_a_record_with_another_field_does_not_stop_the_mending_of_others(tmp_path: Path) -> None:
    one, two = Bench(tmp_path / "store", "Placement"), Bench(tmp_path / "store", "Rivals")
    there = behind(one.store)
    name = one.records[0]
    there.put(name, there.get(name).replace(b'"bytes"', b'"bytec"'))
    trial = two.try_damage(Damage("flip", f"{two.object_name}/zarr.json", 80))
    assert [wrong for wrong in trial.wrong if name not in wrong] == []
    assert trial.made_again


def test_a_flipped_bit_in_the_pointer_to_the_newest_stops_no_step(tmp_path: Path) -> None:
    tried = Bench(tmp_path / "store", "Placement")
    there = behind(tried.store)
    pointer, key = there.get(tried.records[1]), tried.first.key.encode()
    assert key in pointer
    there.put(tried.records[1], pointer.replace(key, key[:5] + b"w" + key[6:]))
    trial = tried.try_damage(Damage("missing", tried.records[0]))
    assert trial.wrong == []
    assert trial.made_again


def test_an_object_of_which_only_empty_folders_are_left_is_made_again(
    bench: Callable[[str], Bench],
) -> None:
    tried = bench("Placement")
    check(tried.try_damage(Damage("hollow", tried.object_name)))


def test_a_sample_of_all_damages(tmp_path: Path) -> None:
    found = list(trials(tmp_path, flips=2, seed=1, share=0.03))
    left = [trial for trial in found if trial.damage.kind != "hollow"]
    assert len({trial.sample for trial in found}) > 8
    assert [trial for trial in left if trial.wrong] == [], report(found)


@pytest.mark.slow
@settings(
    max_examples=25,
    deadline=None,
    derandomize=True,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)
@given(data=st.data(), name=st.sampled_from(SAMPLES))
def test_hit_means_verified_in_a_bucket_too(s3: object, data: st.DataObject, name: str) -> None:
    tried = Bench(f"s3://{BUCKET}/{uuid.uuid4().hex}/store", name)
    file = file_of(tried, data)
    size = len(behind(tried.store).get(file))
    damage = data.draw(
        st.integers(0, 8 * size - 1).map(lambda bit: Damage("flip", file, bit))
        | st.integers(0, size - 1).map(lambda left: Damage("cut", file, left))
        | st.just(Damage("missing", file))
    )
    check(tried.try_damage(damage))


def test_the_bench_notices_what_is_served_damaged(
    bench: Callable[[str], Bench], monkeypatch: pytest.MonkeyPatch
) -> None:
    """With a store that does not hash what it reads, the tests above fail."""
    tried = bench("Placement")
    file = f"{tried.object_name}/zarr.json"
    at = behind(tried.store).get(file).index(b'"text"') + 1
    monkeypatch.setattr(MemberReader, "get", lambda reader, path: reader._read(path, 0, None))
    trial = tried.try_damage(Damage("flip", file, 8 * at))
    assert {
        "it was read as if it were whole",
        "a wrong value was read",
        "it was not made again",
        "a wrong value was served",
    } <= set(trial.wrong)
