"""Strategies as data: the contents of the eight files, and strategies that a chain
cannot carry out are refused in one line."""

import pytest
from support import chain_of, refused

from elastocal.study.strategies import (
    check_strategy,
    drop_superseded_stages,
    strategy_from_document,
)

ALL = (0, 1, 2, 3, 4, 5)
# Joints that the last stage fixes, or all if it fixes none, and measured points.
PAPERS = {
    "6DoF": (ALL, {"6DoF"}),
    "6DoF-after-3DoF": (ALL, {"3DoF", "6DoF"}),
    "4-6DoF-after-3DoF": ((0, 1, 2), {"3DoF", "6DoF"}),
    "6DoF-after-3+3DoF": (ALL, {"3DoF", "6DoF"}),
    "3+6DoF-comb": (ALL, {"3DoF", "6DoF"}),
    "4-6DoF-after-6+3DoF": ((0, 1, 2), {"3DoF", "6DoF"}),
    "3-6DoF-after-2DoF": ((0, 1), {"2DoF", "6DoF"}),
    "5-6DoF-after-4DoF": ((0, 1, 2, 3), {"4DoF", "6DoF"}),
}


def test_the_repository_has_the_eight_strategies_of_the_paper(strategies):
    assert set(strategies) == set(PAPERS)
    for file, strategy in strategies.items():
        assert strategy.name.replace(" ", "-") == file


@pytest.mark.parametrize("name", PAPERS)
def test_fixed_joints_are_those_of_the_last_stage_and_each_point_is_named_once(
    strategies, name
):
    fixed, points = PAPERS[name]
    assert strategies[name].fixed_joints == fixed
    assert set(strategies[name].points) == points and len(
        strategies[name].points
    ) == len(points)


def test_a_stage_that_identifies_every_joint_supersedes_the_stages_before_it(
    strategies,
):
    kept_stages = {
        name: drop_superseded_stages(strategy, 6).stages
        for name, strategy in strategies.items()
    }
    assert (
        kept_stages.pop("6DoF-after-3DoF")
        == kept_stages.pop("6DoF-after-3+3DoF")
        == strategies["6DoF"].stages
    )
    assert kept_stages == {name: strategies[name].stages for name in kept_stages}


CHAIN = chain_of("Rz(q1) Tx(1) Ry(q2) Tx(1) [A] Ry(q3) Tx(1) [B]")
STAGED = [
    {"points": ["A"], "joints": [1, 2]},
    {"points": ["B"], "joints": [3], "held": [1, 2]},
]


def stages(*changes):
    """STAGED with the given keys of its first, second ... stage replaced."""
    return [stage | change for stage, change in zip(STAGED, changes, strict=True)]


FAULTS = {
    "unknown point": (
        stages({"points": ["C"]}, {}),
        "stages[0].points",
        ["'C'", "A, B"],
    ),
    "unknown point later": (
        stages({}, {"points": ["A", "end"]}),
        "stages[1].points",
        ["'end'", "A, B"],
    ),
    "joint that the robot has not": (
        stages({}, {"joints": [3, 4]}),
        "stages[1].joints",
        ["joint 4", "move B: 1, 2, 3"],
    ),
    "joint behind the point": (
        stages({"joints": [1, 2, 3]}, {}),
        "stages[0].joints",
        ["joint 3", "move A: 1, 2"],
    ),
    "joint in neither list": (
        stages({"joints": [1]}, {}),
        "stages[0]",
        ["joint 2", "in joints or held"],
    ),
    "nothing held": (
        stages({}, {"held": []}),
        "stages[1]",
        ["joint 1, 2", "1, 2, 3 in joints or held"],
    ),
    "held before it is known": (
        stages({"joints": [1], "held": [2]}, {}),
        "stages[0].held",
        ["joint 2", "none"],
    ),
    "held that is no joint": (
        stages({}, {"held": [1, 2, 7]}),
        "stages[1].held",
        ["joint 7", "earlier stages: 1, 2"],
    ),
    "held and identified": (
        stages({}, {"joints": [2, 3]}),
        "stages[1].held",
        ["joint 2", "earlier stages"],
    ),
    "joint that no stage identifies": (
        STAGED[:1],
        "stages",
        ["joint 3", "every joint"],
    ),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_faulty_strategy_is_refused_in_one_line(fault):
    documents, key, allowed = FAULTS[fault]
    strategy = strategy_from_document({"name": fault, "stages": documents})
    with refused("strategies/x.yaml", f"{key}:", *allowed):
        check_strategy(strategy, CHAIN, "strategies/x.yaml")
