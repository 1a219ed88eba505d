"""Reliability of stated probabilities, and wrong names, of several blind runs together.

`python benchmarks/pooled_runs.py docs/blind_29_november_cases.parquet
docs/blind_cases.parquet`, with tables that `stated_probabilities.py --save` has written
besides, prints a line for each bin with its 95 % interval (Clopper and
Pearson, 1934), the largest error of a bin with 30 cases and what calibrated statements
would show by chance, and how often one wrong mechanism is stated without alternatives,
and how often any false one, if the cause is not in the catalogue. A row of a file is a case.
"""

import argparse

import pandas as pd
from rates import format_rate

from elastocal_proof.blind.summary import (
    find_largest_bin_error,
    simulate_largest_bin_error,
    tabulate_reliability,
)

SEED = 1


def print_reliability(cases: pd.DataFrame) -> None:
    """Print the reliability diagram of all cases."""
    table = tabulate_reliability(cases)
    print("stated from, to; mean stated; right; cases; share right, % (95 %)")
    for point in table[table.group == "all"].to_dict("records"):
        share, low, high = (100 * point[name] for name in ("rate", "low", "high"))
        print(
            f"{point['from']:.1f}, {point['to']:.1f}; {100 * point['stated']:.1f}; "
            f"{point['hits']}; {point['cases']}; {share:.1f} ({low:.1f}-{high:.1f})"
        )
    stated_cases = cases[cases.stated.notna()]
    largest = find_largest_bin_error(stated_cases)
    by_chance = simulate_largest_bin_error(stated_cases, SEED)
    chance, low, high = (100 * by_chance[name] for name in ("rate", "low", "high"))
    print(
        f"largest error of a bin with enough cases: {100 * largest['rate']:.1f}; "
        f"by chance {chance:.1f} ({low:.1f}-{high:.1f})"
    )


def main() -> None:
    """Read the files that the arguments name, and print their rates."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("files", nargs="+", help="tables as docs/blind_cases.parquet")
    files = parser.parse_args().files
    cases = pd.concat([pd.read_parquet(file) for file in files], ignore_index=True)
    print_reliability(cases)
    outside = cases[cases.group == "outside"]
    print("one wrong mechanism alone, outside:", format_rate(outside.wrong_name))
    print("any false mechanism, outside:", format_rate(outside.false_mechanism))


if __name__ == "__main__":
    main()
