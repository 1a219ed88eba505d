"""Identification strategies as data: stages of (points measured, joints identified,
joints held from an earlier stage)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from elastocal.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from elastocal.mechanics.chain import Chain


@dataclass(frozen=True)
class Stage:
    """One least-squares problem of a strategy.

    `points`: measuring points whose measurements it uses, with equal weight.
    `identified`: joint indices, from 0, that it estimates. `fixed`: joint indices whose
    estimates it takes over from earlier stages.
    """

    points: tuple[str, ...]
    identified: tuple[int, ...]
    fixed: tuple[int, ...] = ()


@dataclass(frozen=True)
class Strategy:
    """A named sequence of stages that together estimate every joint.

    `name`: as printed in the paper.
    """

    name: str
    stages: tuple[Stage, ...]

    @property
    def points(self) -> tuple[str, ...]:
        """Names of all points that the strategy measures, each once, in order of
        use."""
        return tuple(
            dict.fromkeys(name for stage in self.stages for name in stage.points)
        )

    @property
    def fixed_joints(self) -> tuple[int, ...]:
        """Joints that the last stage takes over (which the paper's k_sigma counts
        alone, interpretation R10); else all.

        Not those that the first stage identifies: "4-6DoF after 6+3DoF" identifies all
        joints there.
        """
        last = self.stages[-1]
        return last.fixed or tuple(
            sorted({joint for stage in self.stages for joint in stage.identified})
        )


def strategy_from_document(document: Mapping[str, Any]) -> Strategy:
    """A strategy from its file, checked by ``schemas/strategy.yaml``, where joints
    count from 1."""

    def joints(stage: Mapping[str, Any], key: str) -> tuple[int, ...]:
        return tuple(joint - 1 for joint in stage.get(key, ()))

    stages = [
        Stage(tuple(each["points"]), joints(each, "joints"), joints(each, "held"))
        for each in document["stages"]
    ]
    return Strategy(document["name"], tuple(stages))


def drop_superseded_stages(strategy: Strategy, joints: int) -> Strategy:
    """What of a strategy equation 11 depends on: a stage that identifies every joint
    forgets those before it."""
    first = max(
        [
            0,
            *(
                index
                for index, stage in enumerate(strategy.stages)
                if len(stage.identified) == joints
            ),
        ]
    )
    return replace(strategy, stages=strategy.stages[first:])


def check_strategy(strategy: Strategy, chain: Chain, source: str) -> None:
    """Refuse a strategy that the chain cannot carry out.

    `source`: named in errors. Raises `InputError`: an unknown point or joint; a joint
    that moves a measured point but is neither identified nor fixed; a fixed joint that
    no earlier stage identified; a joint that no stage identifies.
    """
    known: set[int] = set()
    names = [p.name for p in chain.points]
    for number, stage in enumerate(strategy.stages):
        where = f"stages[{number}]"
        for name in stage.points:
            if name not in names:
                raise InputError(
                    source, f"{where}.points", repr(name), ", ".join(names)
                )
        moving = {
            joint
            for name in stage.points
            for joint in chain.moved_by(chain.point(name))
        }
        for joint in stage.identified:
            if joint not in moving:
                allowed = (
                    f"joints that move {', '.join(stage.points)}: {_numbers(moving)}"
                )
                raise InputError(
                    source, f"{where}.joints", f"joint {joint + 1}", allowed
                )
        for joint in stage.fixed:
            if joint not in known or joint in stage.identified:
                raise InputError(
                    source,
                    f"{where}.held",
                    f"joint {joint + 1}",
                    f"joints of earlier stages: {_numbers(known)}",
                )
        if left := moving - set(stage.identified) - set(stage.fixed):
            raise InputError(
                source,
                where,
                f"joint {_numbers(left)} in neither list",
                f"{_numbers(moving)} in joints or held",
            )
        known |= set(stage.identified)
    if left := set(range(chain.coordinates)) - known:
        raise InputError(
            source,
            "stages",
            f"no stage for joint {_numbers(left)}",
            "every joint identified in some stage",
        )


def _numbers(joints: Iterable[int]) -> str:
    return ", ".join(str(joint + 1) for joint in sorted(joints)) or "none"
