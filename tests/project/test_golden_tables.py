"""Tables of the proofs from fixed documents stay as they are.

They were written when a second implementation agreed in every cell. If a table is meant
to change, write it again: `GOLDEN=write python -m pytest
tests/project/test_golden_tables.py`.
"""

import os
from itertools import product
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from made_blind_documents import (
    PLAN,
    make_effect,
    make_oracle,
    make_truth,
    make_verdict,
    tabulate_cases,
)
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
from elastocal_proof.blind.locations import (
    list_locations,
    tabulate_confusion,
    tabulate_locations,
)
from elastocal_proof.blind.scores import list_intervals
from elastocal_proof.blind.summary import (
    summarize_figures,
    tabulate_rates,
    tabulate_reliability,
)
from elastocal_proof.league.methods import deal_folds
from elastocal_proof.league.table import compare_methods, summarize_mechanisms

GOLDEN = Path(__file__).resolve().parents[1] / "golden"
NAMES = sorted(
    path.stem
    for group in ("blind", "closed_loop", "league")
    for path in GOLDEN.glob(f"{group}_*.csv")
)
SEED = 1


def made_tables():
    """Make all tables, by the names of their golden files."""
    # No run has robots that were used for tuning beside others.
    entries = [entry for entry in _cases() if entry[0]["case"]["robots"] == "proof"]
    cases = tabulate_cases(*entries)
    spans = pd.DataFrame(
        [
            row
            for document, stated, _ in entries
            for row in list_intervals(document, stated)
        ]
    )
    locations = tabulate_locations(
        [
            row
            for document, stated, _ in entries
            for row in list_locations(document, stated)
        ]
    )
    moves = _moves()
    moves.loc[(moves["pose"] == 3) & (moves["model"] == "geometry"), "corrected"] = (
        False
    )
    errors = compute_case_errors({"kuka": moves})
    blind = {
        "cases": cases,
        "intervals": spans,
        "locations": locations,
        "confusion": tabulate_confusion(locations),
        "rates": tabulate_rates(cases),
        "reliability": tabulate_reliability(cases),
    }
    blind |= {"summary": summarize_figures(PLAN, cases, spans, SEED, locations)}
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
    """Yield ground truths with verdicts and oracles of every group that is scored.

    The verdicts are right, a class, wrong, or name nothing.
    """
    draws = np.random.default_rng(3)
    groups = [("single", 200.0), ("single", 50.0), ("setting", 50.0)]
    groups += [("several_joints", 200.0), ("outside", 200.0), ("none", 0.0)]
    for number in range(90):
        group, level = groups[number % len(groups)]
        is_right = draws.random() < 0.7
        document = _ground_truth(number, group, level)
        stated = _verdict(number, document, draws, is_right=is_right)
        stated |= {"campaign": document["campaign"]}
        yield document, stated, make_oracle(rms=1e-4 * (1 + 0.02 * draws.random()))


def _ground_truth(number, group, level):
    joint = 1 + number % 6
    kind = "outside:slipping_zero" if group == "outside" else "joint_offset"
    has_defect = group != "none" and number % 18 != 2
    document = make_truth(
        *([(kind, joint)] if has_defect else []),
        group=group,
        level=level,
        campaign=f"case_{number:03}",
        robot="kuka" if number % 5 == 0 else "rx160",
        setting="force_3kN" if group == "setting" else "usual",
    )
    for defect in document["defects"]:
        defect["parameters"] = {"offset": 1e-4}
    return document


def _verdict(number, document, draws, *, is_right):
    size = 1e-4 * (1 + 0.3 * draws.standard_normal())
    named = make_effect(
        "joint_offset" if is_right else "payload",
        1 + number % 6,
        parameters=[("offset", size, 3e-5)],
        alternatives=["payload"],
    )
    is_adequate = is_right and not document["defects"]
    kind = "class" if number % 7 == 0 else "named"
    effects = [] if is_adequate else [named]
    after = 1e-4 * (1 + 0.1 * draws.random())
    stated = make_verdict(
        "adequate" if is_adequate else kind,
        *effects,
        after=after,
        freedom=288,
        compliance=1 + 0.1 * draws.random(),
    )
    probability = 0.5 + 0.49 * draws.random()
    mechanisms = [entry["name"] for entry in effects]
    sets = [
        {"mechanisms": mechanisms, "probability": probability},
        {"mechanisms": ["other"], "probability": 1 - probability},
    ]
    stated["probabilities"] = {"nothing": 0.01, "alarm_p_value": 0.002, "sets": sets}
    return stated


def _moves(cases=8, poses=30, seed=2, reached=0.5):
    """Draw poses of the closed loop, with normal errors whose size depends on the model.

    A share `reached` of each error is not noise.
    """
    draws = np.random.default_rng(seed)
    sizes = dict(zip(MODELS, (3e-3, 2e-3, 2e-4, 1.1e-4, 1e-4), strict=True))
    rows = []
    for case, path_type, model in product(range(cases), PARTS, MODELS):
        error_m = np.linalg.norm(
            sizes[model] / np.sqrt(3) * draws.standard_normal((poses, 3)), axis=1
        )
        row = {
            "effect": "payload",
            "seed": case,
            "verdict": "named",
            "named": case % 2 == 0,
            "part": path_type,
            "model": model,
        }
        row |= {
            "pose": np.arange(poses),
            "reached_error_m": reached * error_m,
            "measured_error_m": error_m,
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
    folds = deal_folds(measured, 4, open_stream(SEED, "one", "league folds", 0))[
        "random"
    ][pose]
    results = {}
    for method, size, std in (
        ("geometry", 2e-4, None),
        ("half", 1e-4, None),
        ("process", 1.2e-4, 1.2e-4),
    ):
        results["one", "random", method] = make_entries(
            size, 40, len(method), std
        ).assign(fold=folds)
    mechanisms = pd.DataFrame(
        {
            "fold": [1, 2, 3, 4, 1],
            "mechanism": ["payload"] * 4 + ["other"],
            "probability": [0.9, 0.8, 1, 1, 0.2],
            "share": 0.3,
        }
    )
    robots = {"A robot": ["one"]}
    league = compare_methods(results, robots, "geometry", SEED)
    return {
        "league": league,
        "mechanisms": summarize_mechanisms({"one": mechanisms}, robots, 4),
    }


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    if os.environ.get("GOLDEN") == "write":
        written = GOLDEN
    else:
        written = tmp_path_factory.mktemp("golden")
    for name, table in made_tables().items():
        write_csv(written / f"{name}.csv", table)
    return written


def test_every_table_is_kept(folder):
    assert {f"{name}.csv" for name in NAMES} >= {
        path.name for path in folder.glob("[bcl]*.csv")
    } and len(NAMES) == 12


@pytest.mark.parametrize("name", NAMES)
def test_a_table_is_what_it_was(name, folder):
    pd.testing.assert_frame_equal(
        pd.read_csv(folder / f"{name}.csv"),
        pd.read_csv(GOLDEN / f"{name}.csv"),
        rtol=1e-7,
        atol=1e-12,
    )
