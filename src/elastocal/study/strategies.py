"""Identification strategies as data: stages of (points measured, joints identified,
joints fixed at the estimates of an earlier stage)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from elastocal.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Iterable

    from elastocal.io.documents import Document
    from elastocal.mechanics.chain import Chain


@dataclass(frozen=True)
class Stage:
    """One least-squares problem of a strategy.

    Attributes
    ----------
    points
        Measuring points whose measurements it uses, with equal weight.
    identified
        Joint indices, from 0, that it estimates.
    fixed
        Joint indices that keep the estimates of earlier stages.
    """

    points: tuple[str, ...]
    identified: tuple[int, ...]
    fixed: tuple[int, ...] = ()


@dataclass(frozen=True)
class Strategy:
    """A sequence of stages that together estimate every joint.

    Attributes
    ----------
    name : str
        As printed in the paper.
    stages
    """

    name: str
    stages: tuple[Stage, ...]

    @property
    def points(self) -> tuple[str, ...]:
        """Names of all measured points, each once, in order of use."""
        return tuple(
            dict.fromkeys(name for stage in self.stages for name in stage.points)
        )

    @property
    def fixed_joints(self) -> tuple[int, ...]:
        """Joints that the last stage keeps fixed; all joints if it fixes none.

        The paper's k_sigma counts only these (interpretation R10). They need not be the
        joints that the first stage identifies: "4-6DoF after 6+3DoF" identifies all
        joints there.
        """
        identified = {joint for stage in self.stages for joint in stage.identified}
        return self.stages[-1].fixed or tuple(sorted(identified))


def strategy_from_document(document: Document) -> Strategy:
    """Make a strategy from its file, where joints count from 1.

    The document is checked by ``schemas/strategy.yaml``.
    """

    def joints(stage: Document, key: str) -> tuple[int, ...]:
        return tuple(joint - 1 for joint in stage.get(key, ()))

    stages = [
        Stage(tuple(stage["points"]), joints(stage, "joints"), joints(stage, "held"))
        for stage in document["stages"]
    ]
    return Strategy(document["name"], tuple(stages))


def drop_superseded_stages(strategy: Strategy, joints: int) -> Strategy:
    """Drop the stages before the last one that identifies all of `joints` joints.

    Under equation 11 such a stage does not depend on the earlier ones.
    """
    first = 0
    for index, stage in enumerate(strategy.stages):
        if len(stage.identified) == joints:
            first = index
    return replace(strategy, stages=strategy.stages[first:])


def check_strategy(strategy: Strategy, chain: Chain, source: str) -> None:
    """Refuse a strategy that the chain cannot carry out.

    Parameters
    ----------
    strategy
    chain
    source : str
        Named in errors.

    Raises
    ------
    InputError
        An unknown point or joint; a joint that moves a measured point but is neither
        identified nor fixed; a fixed joint that no earlier stage identified; a joint
        that no stage identifies.
    """
    identified: set[int] = set()
    for number, stage in enumerate(strategy.stages):
        _check_stage(stage, chain, identified, (source, f"stages[{number}]"))
        identified |= set(stage.identified)
    missing = set(range(chain.coordinates)) - identified
    if missing:
        raise InputError(
            source,
            "stages",
            f"no stage for joint {_number_joints(missing)}",
            "every joint identified in some stage",
        )


def _check_stage(
    stage: Stage, chain: Chain, identified: set[int], location: tuple[str, str]
) -> None:
    """Refuse a stage that the chain cannot carry out.

    `identified` are the joints that earlier stages identified; `location` is the source
    and the key of the stage.
    """
    source, key = location
    names = [point.name for point in chain.points]
    for name in stage.points:
        if name not in names:
            raise InputError(source, f"{key}.points", repr(name), ", ".join(names))
    moving = {
        joint for name in stage.points for joint in chain.moved_by(chain.point(name))
    }
    for joint in stage.identified:
        if joint not in moving:
            points = ", ".join(stage.points)
            allowed = f"joints that move {points}: {_number_joints(moving)}"
            raise InputError(source, f"{key}.joints", f"joint {joint + 1}", allowed)
    for joint in stage.fixed:
        if joint not in identified or joint in stage.identified:
            allowed = f"joints of earlier stages: {_number_joints(identified)}"
            raise InputError(source, f"{key}.held", f"joint {joint + 1}", allowed)
    unused = moving - set(stage.identified) - set(stage.fixed)
    if unused:
        raise InputError(
            source,
            key,
            f"joint {_number_joints(unused)} in neither list",
            f"{_number_joints(moving)} in joints or held",
        )


def _number_joints(joints: Iterable[int]) -> str:
    """Numbers of joints, from 1, for messages."""
    return ", ".join(str(joint + 1) for joint in sorted(joints)) or "none"
