"""A support's outline is written short and true, and says how true."""

from __future__ import annotations

import numpy as np
import pytest

from flows.report.support_document import support_document
from garden_models.geometry.outline import Grid, outer_polygon, signed_area
from garden_models.scene import SupportSurface


def test_an_outline_of_cells_is_written_with_few_vertices() -> None:
    rng = np.random.default_rng(0)
    filled = np.zeros((90, 140), bool)
    filled[5:-5, 5:-5] = True
    filled[3:5] |= rng.random((2, 140)) < 0.5  # a ragged edge, as from noisy points
    outline = outer_polygon(filled, Grid(np.array([3.0, -7.0]), 0.02, filled.shape))
    area = abs(signed_area(outline))
    written = support_document(SupportSurface("table_1", "table", 0.4, outline, area, 9))
    short = np.array(written["outline_gv"])
    assert len(short) < len(outline) / 4
    assert abs(signed_area(short)) == pytest.approx(written["area_m2"], rel=0.02)
    assert 0 < written["outline_tolerance_m"] <= 0.021 * np.sqrt(area)
    away = np.linalg.norm(short[:, None] - outline[None], axis=2).min(axis=1)
    assert away.max() < 1e-4  # its vertices are the outline's own
