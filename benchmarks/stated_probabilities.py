"""How often is a stated probability right? On simulated robots of a size of the blind
benchmark, of which `--cases` are drawn by a seed.

Prints the reliability diagram, wrong single names, the names that are right alone, and
the joints of named effects, each with its 95 % interval. `--save FILE` writes a row of
each case, which `pooled_runs.py` reads. Choose settings with one seed and judge them
with another.
"""

import argparse
import tempfile
from pathlib import Path

import pandas as pd
from rates import format_rate

from elastocal.diagnosis.diagnose import diagnose
from elastocal.diagnosis.settings import Settings
from elastocal.io.documents import read_document
from elastocal.io.json_files import read_json
from elastocal.loop.whole import read_cases
from elastocal_proof.blind.cases import list_cases, write_sealed_case
from elastocal_proof.blind.locations import list_locations
from elastocal_proof.blind.scores import build_case_row
from elastocal_proof.blind.summary import tabulate_reliability

CONFIG = Path(__file__).resolve().parents[1] / "config"
# Setting of config/blind.yaml without an effect in which the base is misplaced.
MISPLACED_SETTING = "tilted_base"


def diagnose_cases(size, count, seed, group, folder):
    """Make and diagnose the first cases of a size, which are a random sample, or those of
    one group among them; return a row of scores and the locations of each."""
    plan = read_document(CONFIG / "blind.yaml")
    robots = CONFIG / "robots"
    rows = []
    locations = []
    for case in list_cases(plan, size, seed)[:count]:
        if group and case.group != group:
            continue
        write_sealed_case(case, folder, folder / "sealed", robots)
        training, _ = read_cases((folder / case.name).as_posix(), robots.as_posix())
        verdict = diagnose(training, Settings(), seed).document
        truth = read_json(folder / "sealed" / f"{case.name}.json")
        rows.append(build_case_row(plan, truth, verdict))
        locations += list_locations(truth, verdict)
    return pd.DataFrame(rows), pd.DataFrame(locations)


def main():
    """Print the figures of a number of cases."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", type=int, default=180)
    parser.add_argument("--seed", type=int, default=11701)
    parser.add_argument("--size", default="development", help="of config/blind.yaml")
    parser.add_argument("--group", help="of config/blind.yaml, such as outside")
    parser.add_argument("--save", type=Path, help="table of the cases, as Parquet")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        cases, locations = diagnose_cases(
            arguments.size,
            arguments.cases,
            arguments.seed,
            arguments.group,
            Path(folder),
        )
    if arguments.save:
        cases.to_parquet(arguments.save)
    reliability = tabulate_reliability(cases)
    print(reliability[reliability.group == "all"].round(3).to_string(index=False))
    outside = cases[cases.group == "outside"]
    named = cases[cases.verdict == "named"]
    print(
        "wrong single name, cause outside the catalogue:",
        format_rate(outside.wrong_name),
    )
    print("wrong single name, all cases:", format_rate(cases.wrong_name))
    print("right name, of those stated alone:", format_rate(named.named_right))
    nothing = cases[cases.truth == "none"]
    # A base that is declared exact and is not is there to be found.
    is_tilted = nothing.setting == MISPLACED_SETTING
    print("alarms without an effect:", format_rate(nothing[~is_tilted].detected))
    if is_tilted.any():
        print("alarms with a misplaced base:", format_rate(nothing[is_tilted].detected))
    if len(locations):
        stated = locations[locations.stated]
        print("joints of named effects, all right:", format_rate(stated.right))
        print("joints of named effects, all wrong:", format_rate(stated.wrong))


if __name__ == "__main__":
    main()
