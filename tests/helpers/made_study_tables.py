"""Tables of the small study, of which the golden files keep each, and the facts of its report."""

from pathlib import Path

import pandas as pd

from elastocal.report.study import study_facts
from elastocal.study.strategies import Stage, Strategy

GOLDEN = Path(__file__).resolve().parents[1] / "golden"
# By the names that the report has for them.
FILES = {"joint": "joint_test", "studies": "strategies_over_studies", "break_even": "break_even", "ladder": "ladder"}
FILES |= {"simulated": "simulated_designs", "budget": "budget", "pairs": "budget_pairs", "needed": "configurations_needed"}
FILES |= {"scores": "strategy_scores", "score_pairs": "strategy_pairs", "comparison": "comparison", "table2": "table2"}
FILES |= {"extended": "extended"}


def table(name):
    return pd.read_csv(GOLDEN / f"study_{FILES[name]}.csv", dtype={"table": str})


def facts(**changed):
    """Facts of the report of these tables, some of which may be changed."""
    names = {"kuka": "Kuka", "kuka_extended": "Kuka with elastic links"}
    settings = {"noise_um": 200.0, "length": 20, "configurations": 20, "classical": "6DoF", "best": "3+6DoF comb"}
    settings |= {"accuracy_um": 120.0, "strategies": [Strategy("6DoF", (Stage(("6DoF",), tuple(range(6))),))]}
    stated = {"force_N": 1000, "offset_m": 0.5, "edge_m": 1.0, "weight_N": 1000, "path_m": 0.5, "cutting_N": 500}
    found = study_facts({name: table(name) for name in FILES} | changed, names, ["kuka"], settings | {"stated": stated})
    return found | {
        "citation": {"authors": "the developers", "date": "2026-11-25", "version": "0.1.0", "license": "MIT"},
        "names": names,
        "full_names": ["Kuka"],
        "size": {"data_sets": "12", "configurations": "20", "test_configurations": "20", "seed": "1"},
    }
