"""Name the conditions under which methods are compared on procedural scenes."""

from __future__ import annotations

from dataclasses import dataclass, field

from garden_models.gravity.training.scenes.furnish import RoomKind
from garden_models.gravity.training.scenes.photographer import PhotographerKind

ESTIMATED_CAMERAS_DEG = 0.3
"""How far each camera's rotation is off where cameras count as estimated (one sigma)."""


@dataclass(frozen=True)
class Condition:
    """What rooms and photos are like; ``cameras_off_deg`` None leaves it to chance."""

    name: str = "as they come"
    room: RoomKind = field(default_factory=RoomKind)
    photographer: PhotographerKind = field(default_factory=PhotographerKind)
    cameras_off_deg: float | None = None


GIVEN = Condition("cameras given", cameras_off_deg=0.0)
ESTIMATED = Condition("cameras estimated", cameras_off_deg=ESTIMATED_CAMERAS_DEG)
MAIN = (GIVEN, ESTIMATED)

CURVES: dict[str, tuple[Condition, ...]] = {
    "camera roll": tuple(
        Condition(f"{roll:g} degrees", photographer=PhotographerKind(roll_deg=roll))
        for roll in (0.0, 15.0, 30.0, 45.0, 90.0, 180.0)
    ),
    "number of views": tuple(
        Condition(f"{photos} views", photographer=PhotographerKind(photos=photos))
        for photos in (2, 3, 5, 8, 12)
    ),
    "lack of planes": (
        Condition("floor and walls", RoomKind(planes=True, slanted=False)),
        Condition("slanted surfaces too", RoomKind(planes=True, slanted=True)),
        Condition("no large planes", RoomKind(planes=False, slanted=False)),
        Condition("no large planes but slanted", RoomKind(planes=False, slanted=True)),
    ),
}
