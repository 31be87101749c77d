"""The paper's latency table, to stand beside ours."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class PaperScene:
    """One scene of the paper: seconds of LiteReality and of GARDEN."""

    scene: str
    litereality_s: float
    garden_s: float

    @property
    def ratio(self) -> float:
        """How many times as long LiteReality took."""
        return self.litereality_s / self.garden_s


SOURCE = (
    "GARDEN: Gravity-Aligned Reconstruction of Disentangled ENvironments from RGB images, "
    'table "End-to-end inference latency" (section Computational Efficiency)'
)
HARDWARE = "Intel Xeon w7-3445 CPU, NVIDIA RTX A6000 GPU"
OBJECTS = "the paper does not say how many objects each scene has"

SCENES = (
    PaperScene("BoardRoom-CUED", 7686, 1244),
    PaperScene("Darwin-BedRoom", 2781, 321),
    PaperScene("Girton-Common-Room", 4507, 512),
    PaperScene("Girton-large-study-room", 2308, 318),
    PaperScene("Girton-Study-Room", 4382, 406),
)
MEAN = PaperScene("Mean", 4332.8, 560.2)
