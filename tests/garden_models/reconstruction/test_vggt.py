"""VGGT's conventions: camera_from_world, quaternion xyzw, fields of view, its own unit."""

from __future__ import annotations

import numpy as np
import pytest

from garden_models.reconstruction import vggt
from garden_models.scene import BadInput
from tests.doubles import vggt as double
from tests.doubles.true_views import box_room
from tests.garden_models.reconstruction.against_truth import assert_true


@pytest.fixture
def truth():
    return box_room(3)


def test_a_rig_goes_through_its_conventions_and_comes_back(truth, tmp_path, monkeypatch):
    double.install_vggt(truth, tmp_path, monkeypatch)
    predict = vggt.load(tmp_path, "cpu")
    found = predict(truth.request())
    assert not found.metric
    assert_true(found, truth, scale=double.VGGT.unit)
    np.testing.assert_allclose(found.views[0].camera_from_world, np.eye(4)[:3], atol=1e-5)
    assert found.views[0].confidence.max() == pytest.approx(0.75)  # 1 - 1/4


def test_with_given_cameras_it_answers_in_their_world(truth, tmp_path, monkeypatch):
    double.install_vggt(truth, tmp_path, monkeypatch)
    assert_true(vggt.load(tmp_path, "cpu")(truth.with_cameras()), truth, scale=1.0, same_world=True)


def test_of_a_tall_photo_it_sees_the_middle(tmp_path, monkeypatch):
    truth = box_room(2, size=(84, 140))
    double.install_vggt(truth, tmp_path, monkeypatch)
    found = vggt.load(tmp_path, "cpu")(truth.request())
    seen = found.views[0].seen
    assert seen.shape == (868, 518) and seen.sum() == 518 * 518 and seen[175:693].all()
    assert (found.views[0].depth > 0).sum() == 518 * 518
    assert_true(found, truth)


@pytest.mark.parametrize("order", [(3, 0, 1, 2), (0, 2, 1, 3)])
def test_another_order_of_the_quaternion_is_another_rig(order):
    wxyz = np.array([0.5, 0.1, 0.7, 0.5])
    wxyz /= np.linalg.norm(wxyz)
    right = np.r_[np.zeros(3), wxyz[1:], wxyz[0], 0.9, 1.1]
    wrong = np.r_[np.zeros(3), right[3:7][list(order)], 0.9, 1.1]
    _, camera = vggt.camera_of(right, (518, 392))
    _, other = vggt.camera_of(wrong, (518, 392))
    assert np.abs(camera - other).max() > 0.1
    np.testing.assert_allclose(camera[:, :3] @ camera[:, :3].T, np.eye(3), atol=1e-9)


def test_what_it_cannot_do_is_refused(truth, tmp_path, monkeypatch):
    with pytest.raises(BadInput, match="holds no weights"):
        vggt.load(tmp_path, "cpu")
    double.install_vggt(truth, tmp_path, monkeypatch)
    predict = vggt.load(tmp_path, "cpu")
    with pytest.raises(BadInput, match="use depth_anything_3"):
        predict(truth.request(want_gaussians=True))
    (tmp_path / "config.json").write_text('{"hidden": 3}')
    with pytest.raises(BadInput, match="take both of the same version"):
        vggt.load(tmp_path, "cpu")
    monkeypatch.undo()
    with pytest.raises(BadInput, match="git clone"):
        vggt.load(tmp_path, "cpu")
