"""Hold the settings of gravity alignment."""

from __future__ import annotations

from dataclasses import dataclass

from garden_models.scene import BadInput


@dataclass(frozen=True)
class AlignGravity:
    """Which methods are asked, and from which disagreement on the result is degraded.

    ``decoder_weights`` is the checkpoint that the method ``view_decoder`` reads; the shipped
    one if empty.
    """

    methods: tuple[str, ...] = ("planes", "vanishing_points", "camera_x_axes")
    max_disagreement_deg: float = 5.0
    decoder_weights: str = ""

    def __post_init__(self) -> None:
        if not self.methods:
            raise BadInput("align_gravity needs at least one method")
        if not 0 < self.max_disagreement_deg <= 90:
            raise BadInput(
                f"max_disagreement_deg is {self.max_disagreement_deg}; it is an angle in "
                "(0, 90] degrees"
            )
