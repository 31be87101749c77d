"""Write bodies and supports as MJCF, the XML of MuJoCo, with mesh files beside it.

One writer serves the simulation (in Gravity-View, gravity +y) and the export (z-up). Masses
and inertias are explicit, so that no importer derives them from meshes. MuJoCo knows no vertex
colours: what is seen carries them as a texture. Options are those of
the paper: time step 0.001 s, Newton, 50 iterations, pyramidal cone. Friction is the only
contact parameter that is set; everything else is MuJoCo's default, and nothing is damped.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from xml.etree import ElementTree

import numpy as np
from jaxtyping import Float, Int, UInt8

from garden_models.geometry.rotation import quaternion_from_matrix, rotation_between
from garden_models.meshing.texture_atlas import MAX_FACES, bake_vertex_colours
from garden_models.physics.config import GRAVITY, ITERATIONS, TIMESTEP
from garden_models.physics.prism import support_prisms
from garden_models.scene import Body, SupportSurface

ZUP_FROM_GV = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
"""Rotation from Gravity-View (y down) to a right-handed z-up frame."""

SUPPORT_FRICTION = 0.3
"""Sliding friction of supports. MuJoCo takes the larger of two, so the body's own decides."""
SUPPORT_THICKNESS = 0.03
"""Metres that a raised support reaches down: enough that nothing passes in a time step."""


@dataclass(frozen=True)
class Mjcf:
    """The XML text and the files that it names: meshes (file name -> OBJ text) and textures
    (file name -> the picture that the PNG file of that name has to hold).
    """

    xml: str
    assets: dict[str, str] = field(default_factory=dict)
    textures: dict[str, UInt8[np.ndarray, "h w 3"]] = field(default_factory=dict)

    @property
    def asset_bytes(self) -> dict[str, bytes]:
        """The meshes as MuJoCo's ``from_xml_string(xml, assets)`` wants them."""
        return {name: text.encode() for name, text in self.assets.items()}


def write_mjcf(
    bodies: tuple[Body, ...],
    supports: tuple[SupportSurface, ...],
    frame_from_gv: Float[np.ndarray, "3 3"],
    *,
    name: str = "scene",
    mesh_prefix: str = "",
    visuals: bool = False,
    keyframes: Mapping[str, tuple[Float[np.ndarray, "4 4"], ...]] | None = None,
) -> Mjcf:
    """Return the model of a scene in the frame that a rotation leads to from Gravity-View.

    Bodies without a support (``supported_by`` empty) have no joint: they stay where they are.
    ``mesh_prefix`` goes before every file's name (a folder). ``visuals`` adds the full meshes,
    textured, which collide with nothing and weigh nothing, and a light. ``keyframes`` maps a
    name to every body's ``gv_from_body`` (fixed bodies too; theirs is left out).
    """
    root = ElementTree.Element("mujoco", model=name)
    ElementTree.SubElement(root, "compiler", angle="radian", autolimits="true")
    ElementTree.SubElement(
        root,
        "option",
        timestep=str(TIMESTEP),
        solver="Newton",
        iterations=str(ITERATIONS),
        cone="pyramidal",
        gravity=_numbers(frame_from_gv @ np.array([0.0, GRAVITY, 0.0])),
    )
    if visuals:
        _add_light(root)
    asset = ElementTree.SubElement(root, "asset")
    world = ElementTree.SubElement(root, "worldbody")
    assets = _Assets(asset, mesh_prefix)
    for support in supports:
        _add_support(world, assets, support, frame_from_gv)
    for body in bodies:
        _add_body(world, assets, body, frame_from_gv, visuals=visuals)
    if keyframes:
        keyframe = ElementTree.SubElement(root, "keyframe")
        for key, poses in keyframes.items():
            qpos = [
                value
                for body, pose in zip(bodies, poses, strict=True)
                if is_free(body)
                for part in _pose(pose, frame_from_gv)
                for value in part
            ]
            ElementTree.SubElement(keyframe, "key", name=key, qpos=_numbers(qpos))
    ElementTree.indent(root)
    return Mjcf(ElementTree.tostring(root, encoding="unicode"), assets.meshes, assets.textures)


@dataclass(frozen=True)
class _Assets:
    """The ``<asset>`` element and the files that it names."""

    element: ElementTree.Element
    prefix: str
    meshes: dict[str, str] = field(default_factory=dict)
    textures: dict[str, UInt8[np.ndarray, "h w 3"]] = field(default_factory=dict)

    def add_mesh(self, name: str, vertices: np.ndarray, faces: np.ndarray) -> None:
        """Name a mesh in the model and keep its file."""
        self._add_obj(name, obj_text(vertices, faces))

    def add_textured_mesh(
        self, name: str, vertices: np.ndarray, faces: np.ndarray, vertex_rgb: np.ndarray
    ) -> None:
        """Name a mesh, a texture and a material in the model and keep their files."""
        atlas = bake_vertex_colours(faces, vertex_rgb)
        picture = self._add_obj(name, obj_text(vertices, faces, atlas.corner_uv)) + ".png"
        self.textures[picture] = atlas.rgb
        ElementTree.SubElement(self.element, "texture", name=name, type="2d", file=picture)
        # The colours already hold the highlights of the photographed room.
        ElementTree.SubElement(
            self.element, "material", name=name, texture=name, specular="0", shininess="0"
        )

    def _add_obj(self, name: str, text: str) -> str:
        """Keep a mesh under a file name that is safe and its own; return it, less ``.obj``."""
        stem = self.prefix + re.sub(r"[^A-Za-z0-9_-]+", "_", name)
        while f"{stem}.obj" in self.meshes:
            stem += "_"
        self.meshes[f"{stem}.obj"] = text
        ElementTree.SubElement(self.element, "mesh", name=name, file=f"{stem}.obj")
        return stem


def _add_light(root: ElementTree.Element) -> None:
    """Light the scene from the viewer, so that what faces it has the colours of the photos.

    They hold the room's light and shade already: a little more shade tells shapes apart.
    """
    visual = ElementTree.SubElement(root, "visual")
    ElementTree.SubElement(
        visual,
        "headlight",
        ambient=_numbers([0.6, 0.6, 0.6]),
        diffuse=_numbers([0.4, 0.4, 0.4]),
        specular=_numbers([0.0, 0.0, 0.0]),
    )


def is_free(body: Body) -> bool:
    """Tell whether a body may move: something carries it."""
    return bool(body.supported_by)


def obj_text(
    vertices: Float[np.ndarray, "v 3"],
    faces: Int[np.ndarray, "f 3"],
    corner_uv: Float[np.ndarray, "f 3 2"] | None = None,
) -> str:
    """Return a mesh as Wavefront OBJ, with texture coordinates (u right, v up) if given."""
    lines = [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in vertices.tolist()]
    numbers = (np.asarray(faces) + 1).tolist()
    if corner_uv is None:
        lines += [f"f {a} {b} {c}" for a, b, c in numbers]
    else:
        # Five decimals err by a hundredth of a texel in the largest texture.
        lines += [f"vt {u:.5f} {v:.5f}" for u, v in corner_uv.reshape(-1, 2).tolist()]
        lines += [
            f"f {a}/{3 * i + 1} {b}/{3 * i + 2} {c}/{3 * i + 3}"
            for i, (a, b, c) in enumerate(numbers)
        ]
    return "\n".join(lines) + "\n"


def _add_support(
    world: ElementTree.Element,
    assets: _Assets,
    support: SupportSurface,
    frame_from_gv: Float[np.ndarray, "3 3"],
) -> None:
    """Add the floor as a plane that faces up, or a raised support as prisms."""
    up = frame_from_gv @ np.array([0.0, -1.0, 0.0])
    friction = _numbers([SUPPORT_FRICTION])
    if support.kind == "floor":
        centre = support.outline_gv.mean(axis=0)
        position = frame_from_gv @ np.array([centre[0], support.height_gv, centre[1]])
        half = float(np.ptp(support.outline_gv, axis=0).max())
        ElementTree.SubElement(
            world,
            "geom",
            name=support.name,
            type="plane",
            size=_numbers([half, half, 0.1]),
            pos=_numbers(position),
            quat=_numbers(quaternion_from_matrix(rotation_between(np.array([0.0, 0, 1]), up))),
            friction=friction,
            rgba="0.8 0.8 0.8 0.3",
        )
        return
    prisms = support_prisms(support.outline_gv, support.height_gv, SUPPORT_THICKNESS)
    for i, prism in enumerate(prisms):
        mesh_name = support.name if len(prisms) == 1 else f"{support.name}_{i}"
        assets.add_mesh(mesh_name, prism.vertices @ frame_from_gv.T, prism.faces)
        ElementTree.SubElement(
            world,
            "geom",
            name=mesh_name,
            type="mesh",
            mesh=mesh_name,
            friction=friction,
            rgba="0.7 0.6 0.5 0.3",
        )


def _add_body(
    world: ElementTree.Element,
    assets: _Assets,
    body: Body,
    frame_from_gv: Float[np.ndarray, "3 3"],
    *,
    visuals: bool,
) -> None:
    """Add a body with its inertia, colliders (group 3) and, if asked, its mesh (group 2)."""
    position, quaternion = _pose(body.gv_from_body, frame_from_gv)
    element = ElementTree.SubElement(
        world, "body", name=body.name, pos=_numbers(position), quat=_numbers(quaternion)
    )
    if is_free(body):
        ElementTree.SubElement(element, "freejoint", name=f"{body.name}_joint")
    inertia = body.inertia
    ElementTree.SubElement(
        element,
        "inertial",
        pos=_numbers(body.centre_of_mass),
        mass=_numbers([body.mass_kg]),
        fullinertia=_numbers([*np.diag(inertia), inertia[0, 1], inertia[0, 2], inertia[1, 2]]),
    )
    for i, piece in enumerate(body.colliders):
        mesh_name = f"{body.name}_collider_{i}"
        assets.add_mesh(mesh_name, piece.vertices, piece.faces)
        ElementTree.SubElement(
            element,
            "geom",
            name=mesh_name,
            type="mesh",
            mesh=mesh_name,
            friction=_numbers([body.friction]),
            group="3",
        )
    if visuals:
        _add_visual(element, assets, body)


def _add_visual(element: ElementTree.Element, assets: _Assets, body: Body) -> None:
    """Add a body's mesh, textured with its vertex colours; in one colour if it has none, or too
    many faces for a texture.
    """
    name = f"{body.name}_visual"
    geom = ElementTree.SubElement(
        element,
        "geom",
        name=name,
        type="mesh",
        mesh=name,
        contype="0",
        conaffinity="0",
        mass="0",
        group="2",
    )
    if len(body.vertex_rgb) and 0 < len(body.faces) <= MAX_FACES:
        assets.add_textured_mesh(name, body.vertices, body.faces, body.vertex_rgb)
        geom.set("material", name)
    else:
        assets.add_mesh(name, body.vertices, body.faces)
        colour = body.vertex_rgb.mean(axis=0) / 255 if len(body.vertex_rgb) else np.full(3, 0.5)
        geom.set("rgba", _numbers([*colour, 1.0]))


def _pose(
    gv_from_body: Float[np.ndarray, "4 4"], frame_from_gv: Float[np.ndarray, "3 3"]
) -> tuple[Float[np.ndarray, "3"], Float[np.ndarray, "4"]]:
    """Return position and quaternion (wxyz) of a body in the model's frame."""
    rotation = frame_from_gv @ gv_from_body[:3, :3]
    return frame_from_gv @ gv_from_body[:3, 3], quaternion_from_matrix(rotation)


def _numbers(values: object) -> str:
    """Return numbers as MJCF writes them, with nine digits and no negative zero."""
    return " ".join(f"{float(value) + 0.0:.9g}" for value in np.atleast_1d(np.asarray(values)))
