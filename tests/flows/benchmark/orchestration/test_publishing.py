"""The peer of publishing: the same Zarr, byte for byte, but for manifest and attributes."""

from __future__ import annotations

from pathlib import Path

from flows.benchmark.orchestration.cost import publishing_section
from flows.benchmark.orchestration.publishing import (
    Throughput,
    depth_stack,
    measure_publishing,
    write_plain_zarr,
)
from storage import Store


def files_of(folder: Path) -> dict[str, bytes]:
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in folder.rglob("*")
        if path.is_file()
    }


def test_both_ways_write_the_same_chunks(tmp_path: Path) -> None:
    value = depth_stack(12_000_000)
    assert 11_000_000 < value.depth.nbytes + value.rgb.nbytes + value.points.nbytes < 13_000_000
    write_plain_zarr(value, tmp_path / "plain")
    store = Store.open(tmp_path / "store")
    ours = files_of(store.folder(store.publish(value).object))
    plain = files_of(tmp_path / "plain")
    assert ours.keys() - plain.keys() == {"manifest.json"}
    assert {name for name in plain if plain[name] != ours[name]} == {"zarr.json"}


def test_both_are_timed_and_nothing_is_left(tmp_path: Path) -> None:
    measured = measure_publishing(tmp_path, 4_000_000, repeats=2)
    assert measured.repeats == 2
    assert measured.published_mb_s > 0
    assert measured.plain_mb_s > 0
    assert list(tmp_path.iterdir()) == []


def test_the_claim_is_a_share_of_plain() -> None:
    assert publishing_section(Throughput(1000, 1, 80.0, 100.0)).claims[0].holds
    assert not publishing_section(Throughput(1000, 1, 79.0, 100.0)).claims[0].holds
