"""Furnished rooms: nothing overlaps, things rest on what carries them, splits share nothing."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from garden_models.disentanglement.training.scenes.furnish import Meshes, furnish
from garden_models.disentanglement.training.scenes.room import Instance, gap, overlap
from garden_models.disentanglement.training.shapes.families import make_shape
from garden_models.disentanglement.training.splits import SPLITS, allowed, split_of_name
from garden_models.scene import BadInput


def digest(shape) -> bytes:
    return np.ascontiguousarray(shape.vertices).tobytes()


@pytest.fixture(scope="module")
def rooms():
    return {split: [furnish(split, number) for number in range(3)] for split in SPLITS}


def test_the_shapes_of_the_test_split_appear_nowhere_else(rooms):
    """By content, not by name: no vertex array of a test room is in another split's."""
    shapes = {
        split: {digest(i.shape) for room in found for i in room.instances}
        for split, found in rooms.items()
    }
    for one, other in itertools.combinations(SPLITS, 2):
        assert shapes[one]
        assert not shapes[one] & shapes[other]
    ranges = [allowed(split) for split in SPLITS]
    for one, other in itertools.combinations(ranges, 2):
        assert one.members[1] <= other.members[0] or other.members[1] <= one.members[0]
        assert one.scenes[1] <= other.scenes[0] or other.scenes[1] <= one.scenes[0]


def test_a_package_mesh_belongs_to_one_split_for_ever():
    names = [f"package:mesh{k}.obj" for k in range(2000)]
    share = [np.mean([split_of_name(n) == split for n in names]) for split in SPLITS]
    np.testing.assert_allclose(share, (0.7, 0.1, 0.2), atol=0.04)
    assert split_of_name("robosuite:can.stl") == split_of_name("robosuite:can.stl")


def test_a_scene_number_outside_of_its_split_is_refused():
    with pytest.raises(BadInput, match="test split"):
        furnish("test", 100_000)


def test_nothing_overlaps_but_chairs_pushed_under_tables(rooms):
    for room in itertools.chain(*rooms.values()):
        for a, b in itertools.combinations(range(len(room.instances)), 2):
            one, other = room.instances[a], room.instances[b]
            if one.rests_on == b or other.rests_on == a:
                continue
            if {"chair"} & {one.shape.family, other.shape.family}:
                continue
            assert not overlap(one, other, 0.0), (one.shape.name, other.shape.name)


def test_things_rest_on_what_carries_them(rooms):
    carried = 0
    for room in itertools.chain(*rooms.values()):
        for instance in room.instances:
            assert instance.box[1, 1] == pytest.approx(instance.position[1])
            if instance.rests_on < 0:
                assert instance.position[1] == 0
                continue
            carried += 1
            base = room.instances[instance.rests_on]
            heights = [base.position[1] - shelf.height for shelf in base.shape.shelves]
            assert min(abs(instance.position[1] - h) for h in heights) < 1e-9
            assert gap(instance, base) < 0
    assert carried > 40


def test_rooms_hold_neighbours_in_contact_and_repeated_instances(rooms):
    touching = repeated = 0
    for room in itertools.chain(*rooms.values()):
        names = [i.shape.name for i in room.instances]
        repeated += len(names) - len(set(names))
        for one, other in itertools.combinations(room.instances, 2):
            same_level = abs(one.position[1] - other.position[1]) < 1e-9
            touching += same_level and -1e-9 <= gap(one, other) < 0.003
    assert touching >= 9
    assert repeated >= 18


def test_a_room_is_a_function_of_its_number():
    one, again = furnish("train", 4), furnish("train", 4)
    assert [i.position for i in one.instances] == [i.position for i in again.instances]
    assert [i.shape.name for i in one.instances] != [
        i.shape.name for i in furnish("train", 5).instances
    ]


def test_package_meshes_stand_among_the_others():
    given = make_shape("teapot", 3999)
    room = furnish("train", 1, Meshes((given,), share=1.0))
    assert sum(i.shape is given for i in room.instances) > 3


def test_footprints_tell_gaps():
    cube = make_shape("can", 0)
    wide = cube.extent[0]
    there = Instance(cube, (wide + 0.01, 0.0, 0.0), 0.0)
    here = Instance(cube, (0.0, 0.0, 0.0), 0.0)
    assert gap(here, there) == pytest.approx(0.01, abs=1e-6)
    assert overlap(here, there, 0.02)
    assert not overlap(here, there, 0.009)
    assert not overlap(here, Instance(cube, (0.0, -1.0, 0.0), 0.0), 0.02)
