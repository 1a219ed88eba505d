"""What the report states of the paper's claims and of the research questions, from the tables of the study."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from elastocal.report.decision_answers import (
    break_even_rows,
    claim_rows,
    cost_facts,
    few_rows,
    joint_rows,
    kind_rows,
    measured_rows,
    simulated_design_rows,
    smallest_designs,
    stiffness_rows,
    study_facts,
)
from elastocal.report.metric_answers import METRIC_NAMES, metric_summary, score_rows, staged_rows
from elastocal.report.question_answers import (
    budget_rows,
    design_facts,
    geometry_rows,
    ladder_rows,
    needed_rows,
    observability_rows,
    place_facts,
    strategy_rows,
    summaries,
    tube_rows,
    weighting_rows,
)

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    import pandas as pd

    from elastocal.study.strategies import Strategy


@dataclass(frozen=True)
class Asked:
    """What the questions are about.

    `titles`: names of the robots without links, by their keys. `classical`, `best`: names of strategies. `length`:
    configurations in a data set of the tables. `joint_range`: of their configurations.
    """

    titles: Mapping[str, str]
    strategies: Sequence[Strategy]
    classical: str
    best: str
    length: int
    accuracy_um: float
    joint_range: str


def answer_questions(tables: Mapping[str, pd.DataFrame], asked: Asked) -> dict[str, Any]:
    """Facts for the report, as `answers.answers`.

    `tables`: of the study, by the names that its rules give them.
    """
    titles, robots, length, accuracy = asked.titles, [*asked.titles], asked.length, asked.accuracy_um
    studies, simulated, scores, pairs = (tables[name] for name in ("studies", "simulated", "scores", "pairs"))
    return {
        "accuracy_um": f"{accuracy:g}",
        "claims": claim_rows(tables["claims"], titles),
        "joint": joint_rows(tables["joint"]),
        "table4": measured_rows(studies, titles),
        "over_studies": [
            {"title": title} | study_facts(studies, robot, asked.classical, asked.best) for robot, title in titles.items()
        ],
        "break_even": break_even_rows(tables["break_even"], accuracy, titles),
        "costs": cost_facts(tables["costs"], titles),
        "simulated": simulated_design_rows(simulated, length, titles),
        "smallest": smallest_designs(simulated, accuracy, titles),
        "few": few_rows(tables["few"], titles),
        "kinds": kind_rows(tables["kinds"], length, titles),
        "stiffness": stiffness_rows(tables["stiffness"], titles),
        "strategies": strategy_rows(asked.strategies),
        "ladder": ladder_rows(tables["ladder"]),
        "budget": budget_rows(tables["budget"], pairs, length, robots),
        "needed": needed_rows(tables["needed"], accuracy, robots),
        "designs": {
            kind: design_facts(some, length, accuracy, titles) for kind, some in tables["designs"].groupby("joint_range")
        },
        "joint_range": asked.joint_range,
        "places": place_facts(tables["places"], titles),
        "scores": score_rows(scores, robots),
        "staged": staged_rows(scores, robots),
        "metrics": metric_summary(tables["score_pairs"], titles),
        "metric_names": METRIC_NAMES,
        "tubes": tube_rows(tables["tubes"]),
        "observability": observability_rows(tables["observability"], robots),
        "summaries": summaries(tables["ladder"], pairs, tables["observability"]),
        "geometry": geometry_rows(tables["geometry"], robots),
        "weighting": weighting_rows(tables["weighting"], robots),
    }
