"""Read the options by which targets are proposed, for one scene or a collection."""

from __future__ import annotations

import argparse
import dataclasses
from dataclasses import dataclass

from flows.scene_request import SceneOptions
from flows.wrong_use import WrongUse

GROUNDING = "grounding_dino"


@dataclass(frozen=True)
class ProposalOptions:
    """Who proposes targets, for what, in place of what the preset says; None: as it says."""

    model: str | None = None
    goal: str | None = None
    labels: tuple[str, ...] = ()

    def applied(self, options: SceneOptions) -> SceneOptions:
        """Return a scene's options with these; WrongUse for a goal that nobody is told."""
        preset = options.preset
        propose, ground = preset.propose, preset.ground
        if self.model is not None:
            propose, ground = (
                dataclasses.replace(propose, model=self.model),
                dataclasses.replace(ground, model=""),
            )
        if self.labels:
            propose = dataclasses.replace(propose, model="")
            ground = dataclasses.replace(
                ground, model=ground.model or GROUNDING, labels=self.labels
            )
        if self.goal is not None:
            if not propose.model:
                raise WrongUse("--goal is told to the model that proposes: give --propose MODEL")
            propose = dataclasses.replace(propose, goal=self.goal)
        return dataclasses.replace(
            options,
            preset=dataclasses.replace(preset, propose=propose, ground=ground),
            propose=options.propose or self.model is not None or bool(self.labels),
        )


def add_proposal_options(parser: argparse.ArgumentParser) -> None:
    """Add the options that have targets proposed."""
    asked = parser.add_mutually_exclusive_group()
    asked.add_argument(
        "--propose",
        metavar="MODEL",
        help="have this vision-language model propose the targets, e.g. gemini-3-flash-preview "
        "(key in $GEMINI_API_KEY; other servers: docs/targets.md); --box and --targets go before",
    )
    asked.add_argument(
        "--label",
        action="append",
        default=[],
        metavar="NAME",
        dest="labels",
        help="find the targets of this name with GroundingDINO; may be repeated",
    )
    parser.add_argument(
        "--goal", metavar="TEXT", help="what the simulation is for, told to the proposing model"
    )


def proposal_options(options: argparse.Namespace) -> ProposalOptions:
    """Return what the options say."""
    return ProposalOptions(options.propose, options.goal, tuple(options.labels))
