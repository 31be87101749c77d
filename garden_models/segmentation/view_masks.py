"""Refine labelled points to label probabilities of the pixels of a view."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Float32, Int
from scipy import ndimage
from scipy.spatial import cKDTree

from garden_models.geometry.camera import pixel_grid, pixel_rays
from garden_models.geometry.rigid import invert_rigid, transform_points
from garden_models.scene import PointCloud, View
from garden_models.segmentation.box import ViewBox
from garden_models.segmentation.colours import colour_bins, colour_counts, colour_posterior
from garden_models.segmentation.node_graph import lab_colours
from garden_models.segmentation.random_walk import ImageEdges, walk_on_image
from garden_models.segmentation.zbuffer import Projection, front_points, project_points

DEPTH_TRUST = 0.5
"""Strength of a pixel's own depth, when it lies on a labelled point (edges are up to 1)."""
SPLAT_TRUST = 0.1
"""Strength of a point seen by other views, where this view has no depth of its own."""
JUMP_TRUST = 0.2
"""What is left of the trust in depth beside a jump, which stereo fattens by some pixels, and
in labels where they change."""
JUMP_WINDOW = 5
"""Pixels across which a jump is felt: about half of a matching window of stereo to both sides."""
COLOUR_STRENGTH = 0.01
HULL_OUTSIDE = 0.2
"""Strength with which pixels that miss the visual hull are background."""
HULL_INSIDE = 0.004
"""Strength with which pixels that see into it are the target."""
OWN_COLOURS = 0.7
"""Weight of a view's own colours against those of all views."""
LEAST_EDGE = 1e-4
BOX_MARGIN = 0.05
"""Share of half the box by which the target may stick out of it."""
SURE = 5.0
"""Strength of what cannot be otherwise."""


@dataclass(frozen=True)
class ViewWindow:
    """The part of a view around the targets, and what is known of its pixels.

    ``node`` is the labelled point that a pixel shows (-1: unknown), ``trust`` its strength;
    ``background`` (strength) is what is certainly no target. ``projection`` is that of
    all nodes into the whole view.
    """

    rows: slice
    columns: slice
    node: Int[np.ndarray, "h w"]
    trust: Float[np.ndarray, "h w"]
    background: Float[np.ndarray, "h w"]
    edges: ImageEdges
    bins: Int[np.ndarray, "h w"]
    projection: Projection
    visible: Bool[np.ndarray, " n"]


def open_window(
    view: View,
    camera_from_gv: Float[np.ndarray, "4 4"],
    nodes: PointCloud,
    tree: cKDTree,
    wanted: Bool[np.ndarray, " n"],
    box: ViewBox | None,
) -> ViewWindow | None:
    """Gather what a view knows around the ``wanted`` nodes; None if it sees none of them.

    ``box`` is the target's box if it was drawn on this view: nothing outside is target.
    """
    width, height = view.size
    projection = project_points(nodes.xyz, view.K, camera_from_gv, view.size)
    inside = wanted & (projection.flat >= 0)
    if inside.sum() < 5:
        return None
    pixels = projection.pixels[inside]
    low, high = np.percentile(pixels, 0.5, axis=0), np.percentile(pixels, 99.5, axis=0)
    margin = 0.15 * (high - low) + 8
    x0, y0 = np.maximum(np.floor(low - margin), 0).astype(int)
    x1, y1 = np.minimum(np.ceil(high + margin), [width, height]).astype(int)
    rows, columns = slice(y0, y1), slice(x0, x1)

    front = front_points(nodes, projection, float(view.K[0, 0]), view.size)
    spacing = float(np.median(nodes.spacing))
    depth = view.depth[rows, columns]
    valid = depth > 0
    rays = pixel_rays(pixel_grid(height, width)[rows, columns], view.K)
    xyz = transform_points(invert_rigid(camera_from_gv), rays * depth[..., None])
    distance, nearest = tree.query(xyz[valid], distance_upper_bound=3.0 * spacing, workers=2)
    node = front.index[rows, columns].copy()
    trust = np.where(node >= 0, SPLAT_TRUST, 0.0)
    node[valid] = np.where(np.isfinite(distance), nearest, -1)
    calm = np.where(_jumps(np.where(valid, depth, np.nan), 8 * spacing), JUMP_TRUST, 1.0)
    own = DEPTH_TRUST * view.confidence[rows, columns] * calm
    trust[valid] = own[valid]
    trust[node < 0] = 0

    # Depth far from all nodes shows something else than the targets' surroundings.
    background = np.where(valid & (node < 0), own * 0.5, 0.0)
    if box is not None:
        outside = ~box.contains(pixel_grid(height, width)[rows, columns], BOX_MARGIN)
        background[outside] = SURE
    lab = lab_colours(view.rgb[rows, columns])
    return ViewWindow(
        rows,
        columns,
        node,
        trust,
        background,
        _edges(lab),
        colour_bins(lab),
        projection,
        _visible(projection, front.z, view.depth, spacing),
    )


def label_pixels(
    window: ViewWindow,
    node_target: Float[np.ndarray, " n"],
    shared_colours: Float[np.ndarray, "2 bins"] | None,
    hull: Bool[np.ndarray, "h w"] | None,
    start: Float32[np.ndarray, "h w"] | None,
) -> tuple[Float32[np.ndarray, "h w"], Float[np.ndarray, "2 bins"]]:
    """Return the probability of the target in the window's pixels, and the colours it saw.

    ``node_target`` is the probability of each node. ``shared_colours`` are the counts of
    (rest, target) summed over all views, ``hull`` the pixels that see into the target's
    visual hull, ``start`` the last round's result (all None in the first round).
    """
    known = np.where(window.node >= 0, node_target[np.maximum(window.node, 0)], np.nan)
    # Points are as coarse as pixels: right where the label changes, the image knows better.
    trust = window.trust * np.where(_jumps(known, 0.5), JUMP_TRUST, 1.0)
    known = np.nan_to_num(known, nan=0.5)
    certain = trust * np.abs(2 * known - 1)
    target, rest = certain * (known > 0.5), certain * (known <= 0.5) + window.background
    if hull is not None:
        target = np.where(hull, target + HULL_INSIDE, 0.0)
        rest = np.where(hull, rest, rest + HULL_OUTSIDE)

    evidence = np.stack([rest.ravel(), target.ravel()], 1).clip(0, 1)
    counts = colour_counts(window.bins.ravel(), evidence)
    mixed = OWN_COLOURS * _normalised(counts)
    if shared_colours is not None:
        mixed += (1 - OWN_COLOURS) * _normalised(shared_colours)
    colour = colour_posterior(mixed, np.full(2, 0.5))[window.bins, 1]
    pull = COLOUR_STRENGTH * np.abs(2 * colour - 1)
    target, rest = target + pull * colour, rest + pull * (1 - colour)
    strength = target + rest
    prior = np.where(strength > 0, target / np.maximum(strength, 1e-12), 0.5)
    result = walk_on_image(
        window.edges, prior.astype(np.float32), strength.astype(np.float32), start
    )
    return result, counts


def votes_of_views(
    windows: list[ViewWindow | None], targets: list[Float32[np.ndarray, "h w"] | None], count: int
) -> tuple[Float[np.ndarray, " n"], Int[np.ndarray, " n"]]:
    """Return for each node the mean target probability of the pixels that show it, and how
    many views see it. A node outside of a view's window is no target there.
    """
    total, seen = np.zeros(count), np.zeros(count, np.int64)
    for window, target in zip(windows, targets, strict=True):
        if window is None or target is None:
            continue
        visible = np.flatnonzero(window.visible)
        column, row = np.floor(window.projection.pixels[visible]).astype(np.int64).T
        row, column = row - window.rows.start, column - window.columns.start
        height, width = target.shape
        inside = (row >= 0) & (column >= 0) & (row < height) & (column < width)
        total[visible[inside]] += target[row[inside], column[inside]]
        seen[visible] += 1
    return total / np.maximum(seen, 1), seen


def _normalised(counts: Float[np.ndarray, "2 bins"]) -> Float[np.ndarray, "2 bins"]:
    return counts / np.maximum(counts.sum(1, keepdims=True), 1e-9)


def _visible(
    projection: Projection,
    front_z: Float[np.ndarray, "h w"],
    depth: Float[np.ndarray, "h w"],
    spacing: float,
) -> Bool[np.ndarray, " n"]:
    """Tell which nodes are the nearest thing in their pixel, by the nodes and the depth."""
    nearest = np.where(depth > 0, depth, front_z).ravel()
    inside = projection.flat >= 0
    out = np.zeros(len(projection.z), bool)
    limit = nearest[projection.flat[inside]] + 3 * spacing
    out[inside] = projection.z[inside] <= limit
    return out


def _jumps(values: Float[np.ndarray, "h w"], limit: float) -> Bool[np.ndarray, "h w"]:
    """Tell around which pixels values differ by more than ``limit``; NaN: unknown."""
    unknown = np.isnan(values)
    high = ndimage.maximum_filter(np.where(unknown, -np.inf, values), JUMP_WINDOW)
    low = ndimage.minimum_filter(np.where(unknown, np.inf, values), JUMP_WINDOW)
    return np.nan_to_num(high - low, nan=0.0, posinf=0.0, neginf=0.0) > limit


def _edges(
    lab: Float[np.ndarray, "h w 3"],
) -> ImageEdges:
    """Return edge weights (right, down, down-right, down-left) from colour contrast.

    Contrast counts relative to the window's own typical contrast between neighbours, so
    that dark, pale and noisy pictures are cut as willingly as others.
    """
    lab = lab.astype(np.float32)
    steps = (
        lab[:, 1:] - lab[:, :-1],
        lab[1:] - lab[:-1],
        lab[1:, 1:] - lab[:-1, :-1],
        lab[1:, :-1] - lab[:-1, 1:],
    )
    squared = [(step**2).sum(-1) for step in steps]
    typical = float(np.mean([square.mean() for square in squared[:2]])) + 1.0
    scale = (1.0, 1.0, np.sqrt(0.5), np.sqrt(0.5))
    weights = [
        (LEAST_EDGE + np.exp(-2.0 * square / typical)).astype(np.float32) * np.float32(factor)
        for square, factor in zip(squared, scale, strict=True)
    ]
    return weights[0], weights[1], weights[2], weights[3]
