"""Fusion: agreement wins, precision weighs, a wrong favourite loses, verdicts are true."""

from __future__ import annotations

import numpy as np
import pytest

from garden_models.geometry.direction import girdle_form, pole_form
from garden_models.geometry.rotation import angle_between_deg, axis_angle
from garden_models.gravity.fuse import fuse_cues
from garden_models.gravity.protocol import Cue, Mode, cue_of_evidence
from garden_models.scene import BadGeometry, GravityEvidence

DOWN = np.array([0.0, 1.0, 0.0])
SIDE = np.array([1.0, 0.0, 0.0])


def off(degrees: float, axis: tuple[float, float, float] = (1, 0, 0)) -> np.ndarray:
    return axis_angle(np.array(axis, dtype=float), np.radians(degrees)) @ DOWN


def pole(axis: np.ndarray, sigma_deg: float, probability: float = 0.8) -> Mode:
    return Mode(pole_form(axis, np.radians(sigma_deg)), probability, "made up")


def cue(method: str, *modes: Mode, odds: float = 3.0) -> Cue:
    return Cue(method, modes, lambda down: odds * float(np.sign(down @ DOWN)))


def test_agreeing_cues_are_weighted_by_precision() -> None:
    fused = fuse_cues((cue("a", pole(off(2), 1)), cue("b", pole(off(-2), 2))))
    # Inverse variances 4 : 1.
    assert angle_between_deg(fused.down_world, off(2 * 4 / 5 - 2 * 1 / 5)) < 0.1
    assert fused.verdict.status == "ok"
    assert all(part.accepted for part in fused.evidence)


def test_more_evidence_is_surer() -> None:
    one = fuse_cues((cue("a", pole(DOWN, 1)),))
    two = fuse_cues((cue("a", pole(DOWN, 1)), cue("b", pole(DOWN, 1))))
    assert two.sigma_deg < one.sigma_deg


def test_the_mode_on_which_others_agree_wins_over_a_favourite() -> None:
    planes = cue("planes", pole(SIDE, 0.5, 0.6), pole(off(1), 0.5, 0.2))
    camera = cue("camera", pole(DOWN, 3, 0.9))
    fused = fuse_cues((planes, camera))
    assert angle_between_deg(fused.down_world, off(1)) < 0.2
    assert fused.verdict.status == "ok"


def test_a_wrong_cue_loses_to_two_and_is_named() -> None:
    wrong = cue("wrong", pole(off(20), 1))
    fused = fuse_cues((cue("a", pole(DOWN, 1)), wrong, cue("b", pole(off(0.5), 1))))
    assert angle_between_deg(fused.down_world, DOWN) < 0.6
    assert [part.accepted for part in fused.evidence] == [True, False, True]
    assert fused.verdict.status == "degraded"
    assert any("wrong differs by" in reason for reason in fused.verdict.reasons)


def test_disagreement_within_the_limit_is_no_reason() -> None:
    cues = (cue("a", pole(DOWN, 0.5)), cue("b", pole(off(0.3), 0.5)), cue("c", pole(off(8), 1)))
    assert fuse_cues(cues, 5.0).verdict.status == "degraded"
    assert fuse_cues(cues, 10.0).verdict.status == "ok"


def test_a_cue_alone_is_degraded() -> None:
    fused = fuse_cues((cue("a", pole(DOWN, 1)),))
    assert fused.verdict.status == "degraded"
    assert "a" in fused.verdict.reasons[0]


def test_equal_rivals_are_admitted() -> None:
    fused = fuse_cues((cue("a", pole(DOWN, 1, 0.45), pole(SIDE, 1, 0.44)),) * 2)
    assert any("another axis" in reason for reason in fused.verdict.reasons)


def test_no_sign_is_admitted() -> None:
    fused = fuse_cues((cue("a", pole(DOWN, 1), odds=0.2), cue("b", pole(DOWN, 1), odds=0.2)))
    assert any("up from down" in reason for reason in fused.verdict.reasons)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_sign_votes_add(sign: float) -> None:
    cues = (
        cue("a", pole(DOWN, 1), odds=5 * sign),
        cue("b", pole(DOWN, 1), odds=-2 * sign),
    )
    assert fuse_cues(cues).down_world @ DOWN * sign > 0.99


def test_wall_and_roll_complete_each_other() -> None:
    wall = Mode(girdle_form(SIDE, np.radians(0.5)), 0.8, "wall")
    roll = Mode(girdle_form(np.array([0.0, 0, 1]), np.radians(1.0)), 0.8, "roll")
    fused = fuse_cues((cue("wall", wall), cue("roll", roll)))
    assert angle_between_deg(fused.down_world, DOWN) < 0.1
    assert fused.sigma_deg < 2
    for part in fused.evidence:
        assert angle_between_deg(part.down_world, DOWN) < 1


def test_a_narrow_accident_does_not_beat_broad_agreement() -> None:
    accidents = [pole(off(7, (0, 0, 1)), 0.6, 0.05), pole(SIDE, 0.6, 0.3)]
    lines = Cue("lines", tuple(accidents), claims_vertical=False)
    fused = fuse_cues((cue("camera", pole(DOWN, 2)), cue("planes", pole(off(1), 2)), lines))
    assert angle_between_deg(fused.down_world, DOWN) < 1.5


def test_world_rotation_turns_the_answer() -> None:
    turn = axis_angle(np.array([1.0, 2, 3]), 2.1)
    modes = [(off(1), 1.0), (off(-2, (0, 0, 1)), 2.0)]
    here = fuse_cues(tuple(cue("c", pole(axis, s)) for axis, s in modes))
    there = fuse_cues(
        tuple(
            Cue("c", (pole(turn @ axis, s),), lambda d: float(np.sign(d @ turn @ DOWN)) * 3)
            for axis, s in modes
        )
    )
    np.testing.assert_allclose(there.down_world, turn @ here.down_world, atol=1e-6)
    assert there.sigma_deg == pytest.approx(here.sigma_deg)


def test_a_stated_direction_can_be_fused_and_can_lose() -> None:
    stated = GravityEvidence("decoder", off(1), 2.0, True)
    fused = fuse_cues((cue_of_evidence(stated), cue("a", pole(DOWN, 1))))
    assert fused.verdict.status == "ok"
    wrong = GravityEvidence("decoder", off(40), 2.0, True)
    fused = fuse_cues((cue_of_evidence(wrong), *[cue("a", pole(DOWN, 1))] * 2))
    assert angle_between_deg(fused.down_world, DOWN) < 0.1


def test_nothing_to_go_by() -> None:
    with pytest.raises(BadGeometry, match="nothing tells where gravity is"):
        fuse_cues(())
