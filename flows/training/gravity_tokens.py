"""Give the tokens that the paper's decoder learns from: the user's data sets and backbone."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from flows.training.chain import each
from garden_models.gravity.training.datasets.read import read_dataset
from garden_models.gravity.training.windows import Windows
from garden_models.scene import BadInput
from tasks.extract_gravity_tokens import extract_gravity_tokens
from tasks.step import Ref


@dataclass(frozen=True)
class TokenData:
    """Where Depth-Anything-3's weights and the data sets (name, folder) are."""

    backbone: Path
    datasets: tuple[tuple[str, Path], ...]
    device: str = "cpu"
    windows: Windows = field(default_factory=Windows)


def token_data(backbone: Path, given: list[str], device: str) -> TokenData:
    """Return the data that ``NAME=FOLDER`` options name. Raises BadInput for what is not there."""
    if not (backbone / "model.safetensors").is_file():
        raise BadInput(f"{backbone}: no model.safetensors; give Depth-Anything-3's weight folder")
    datasets = []
    for option in given:
        name, separator, folder = option.partition("=")
        if not separator:
            raise BadInput(
                f"--data {option}: write it as NAME=FOLDER, as tartanair=/data/tartanair"
            )
        datasets.append((name, Path(folder)))
    if not datasets:
        raise BadInput("no data set was given: --data tartanair=FOLDER (hypersim, vkitti2)")
    return TokenData(backbone, tuple(datasets), device)


def token_shards(data: TokenData) -> tuple[Ref, ...]:
    """Extract the tokens of every sequence, or find them in the store. Raises StepFailed."""
    jobs = [
        (name, root, sequence.name)
        for name, root in data.datasets
        for sequence in read_dataset(name, root)
        if len(sequence) >= data.windows.fewest
    ]
    return each(
        lambda job: extract_gravity_tokens(
            job[0],
            str(job[1]),
            job[2],
            str(data.backbone),
            data.windows,
            data.device,
            label=job[2],
        ),
        jobs,
    )
