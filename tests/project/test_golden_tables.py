"""Tables of the proofs from documents that never change: what they were when a second
implementation agreed in every cell.

Where a table is meant to change, write it anew: `GOLDEN=write python -m pytest
tests/project/test_golden_tables.py`.
"""

import os
from itertools import product
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from made_blind_documents import PLAN, effect, frame, oracle, truth, verdict
from made_leagues import make_entries

from elastocal.io.data_frames import write_csv
from elastocal.random_streams import open_stream
from elastocal_proof.blind.closed_loop import (
    MODELS,
    PARTS,
    compute_case_errors,
    count_cases_within_goal,
    summarize_errors,
)
from elastocal_proof.blind.scores import list_intervals
from elastocal_proof.blind.summary import (
    summarize_figures,
    tabulate_rates,
    tabulate_reliability,
)
from elastocal_proof.league.methods import dealt
from elastocal_proof.league.table import league_table, mechanism_table

GOLDEN = Path(__file__).resolve().parents[1] / "golden"
NAMES = sorted(
    path.stem
    for of in ("blind", "closed_loop", "league")
    for path in GOLDEN.glob(f"{of}_*.csv")
)
SEED = 1


def made_tables():
    """Each by the name of its golden file."""
    # Those of robots that were tuned on stand in no run beside others.
    entries = [entry for entry in _cases() if entry[0]["case"]["robots"] == "proof"]
    cases = frame(*entries)
    spans = pd.DataFrame(
        [row for document, said, _ in entries for row in list_intervals(document, said)]
    )
    moves = _moves()
    moves.loc[(moves["pose"] == 3) & (moves["model"] == "geometry"), "corrected"] = (
        False
    )
    errors = compute_case_errors({"kuka": moves})
    blind = {
        "cases": cases,
        "intervals": spans,
        "rates": tabulate_rates(cases),
        "reliability": tabulate_reliability(cases),
    }
    blind |= {"summary": summarize_figures(PLAN, cases, spans, SEED)}
    loop = {
        "cases": errors,
        "closed_loop": summarize_errors(errors, SEED),
        "goals": count_cases_within_goal(errors),
    }
    groups = {"blind": blind, "closed_loop": loop, "league_small": _league()}
    return {
        f"{group}_{name}": table
        for group, tables in groups.items()
        for name, table in tables.items()
    }


def _cases():
    """Ground truths with verdicts and oracles: right, in a class, wrong, silent, of
    every group that is scored."""
    draws = np.random.default_rng(3)
    groups = [("single", 200.0), ("single", 50.0), ("setting", 50.0)]
    groups += [("several_joints", 200.0), ("outside", 200.0), ("none", 0.0)]
    for number in range(90):
        group, level = groups[number % len(groups)]
        joint = 1 + number % 6
        right = draws.random() < 0.7
        kind = "outside:slipping_zero" if group == "outside" else "joint_offset"
        places = [] if group == "none" or number % 18 == 2 else [(kind, joint)]
        where = {
            "robot": "kuka" if number % 5 == 0 else "irb7600",
            "setting": "force_3kN" if group == "setting" else "usual",
        }
        document = truth(
            *places, group=group, level=level, campaign=f"case_{number:03}", **where
        )
        for defect in document["defects"]:
            defect["parameters"] = {"offset": 1e-4}
        size = 1e-4 * (1 + 0.3 * draws.standard_normal())
        name = "joint_offset" if right else "payload"
        found = effect(
            name, joint, parameters=[("offset", size, 3e-5)], alternatives=["payload"]
        )
        word = (
            "adequate" if not places and right else ("named", "class")[number % 7 == 0]
        )
        effects = [] if word == "adequate" else [found]
        after = 1e-4 * (1 + 0.1 * draws.random())
        said = verdict(
            word,
            *effects,
            after=after,
            freedom=288,
            compliance=1 + 0.1 * draws.random(),
        )
        top = [each["name"] for each in effects]
        stated = 0.5 + 0.49 * draws.random()
        sets = [
            {"mechanisms": top, "probability": stated},
            {"mechanisms": ["other"], "probability": 1 - stated},
        ]
        said["probabilities"] = {"nothing": 0.01, "alarm_p_value": 0.002, "sets": sets}
        yield (
            document,
            said | {"campaign": document["campaign"]},
            oracle(rms=1e-4 * (1 + 0.02 * draws.random())),
        )


def _moves(cases=8, poses=30, seed=2, reached=0.5):
    """Poses of cases of the closed loop, errors normal and of a size for each model; a
    share `reached` of each is no noise."""
    draws = np.random.default_rng(seed)
    sizes = dict(zip(MODELS, (3e-3, 2e-3, 2e-4, 1.1e-4, 1e-4), strict=True))
    rows = []
    for case, part, model in product(range(cases), PARTS, MODELS):
        off = np.linalg.norm(
            sizes[model] / np.sqrt(3) * draws.standard_normal((poses, 3)), axis=1
        )
        row = {
            "effect": "payload",
            "seed": case,
            "verdict": "named",
            "named": case % 2 == 0,
            "part": part,
            "model": model,
        }
        row |= {
            "pose": np.arange(poses),
            "reached_error_m": reached * off,
            "measured_error_m": off,
        }
        rows.append(
            pd.DataFrame(row | {"predicted_std_m": sizes[model], "corrected": True})
        )
    return pd.concat(rows, ignore_index=True)


def _league():
    pose = make_entries(1e-4, 40)["pose"].to_numpy()
    angles = np.random.default_rng(5).uniform(-1, 1, (pose.max() + 1, 3))[pose]
    measured = SimpleNamespace(
        session=np.zeros(len(pose), np.int32), pose=pose, joint_angles=angles
    )
    folds = dealt(measured, 4, open_stream(SEED, "one", "league folds", 0))["random"][
        pose
    ]
    results = {}
    for method, size, std in (
        ("geometry", 2e-4, None),
        ("half", 1e-4, None),
        ("process", 1.2e-4, 1.2e-4),
    ):
        results["one", "random", method] = make_entries(
            size, 40, len(method), std
        ).assign(fold=folds)
    found = pd.DataFrame(
        {
            "fold": [1, 2, 3, 4, 1],
            "mechanism": ["payload"] * 4 + ["other"],
            "probability": [0.9, 0.8, 1, 1, 0.2],
            "share": 0.3,
        }
    )
    robots = {"A robot": ["one"]}
    league = league_table(results, robots, "geometry", SEED)
    return {"league": league, "mechanisms": mechanism_table({"one": found}, robots, 4)}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    place = (
        GOLDEN
        if os.environ.get("GOLDEN") == "write"
        else tmp_path_factory.mktemp("golden")
    )
    for name, table in made_tables().items():
        write_csv(place / f"{name}.csv", table)
    return place


def test_every_table_is_kept(folder):
    assert {f"{name}.csv" for name in NAMES} >= {
        path.name for path in folder.glob("[bcl]*.csv")
    } and len(NAMES) == 10


@pytest.mark.parametrize("name", NAMES)
def test_a_table_is_what_it_was(name, folder):
    pd.testing.assert_frame_equal(
        pd.read_csv(folder / f"{name}.csv"),
        pd.read_csv(GOLDEN / f"{name}.csv"),
        rtol=1e-7,
        atol=1e-12,
    )
