"""Widen a box that was drawn a little too small for what stands in it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from garden_models.segmentation.carrier import Carrier
from garden_models.segmentation.node_graph import NodeGraph
from garden_models.segmentation.region import BoxView

TIGHT = 0.25
"""Share of half the box by which a box may be too small."""
BEYOND = 0.005
"""Share of an object's nodes that may lie anywhere: noise."""


def widened(graph: NodeGraph, one: BoxView, carrier: Carrier, margin: float) -> BoxView:
    """Return the box, grown if what fills its middle ends a little outside of it.

    ``margin`` is the share of half the box by which objects stick out of any box. What goes
    on further, or touches what does, is no object of a tight box: that box stays.
    """
    parts = graph.components(carrier.below < -carrier.band)
    held = parts[carrier.core & (parts >= 0)]
    if len(held) == 0:
        return one
    whole = parts == np.bincount(held).argmax()
    seen = one.project(graph.cloud.xyz[whole])
    wider = replace(one, box=one.box.grown(TIGHT))
    sticks_out = float(np.mean(~one.inside(seen, margin)))
    goes_on = float(np.mean(~wider.inside(seen, 0.0)))
    return wider if sticks_out > BEYOND and goes_on < BEYOND else one
