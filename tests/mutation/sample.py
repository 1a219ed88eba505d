"""Mutation testing of a random sample: how often do the tests detect a small fault in the
code?

mutmut makes the mutants, and finds the tests of the same package that cover them. Steps
of the study that no such test runs are run by the small study, and its golden tables are
their tests. Mutants that change only the text of a string are left out. mutmut itself
leaves out annotations, code outside functions, and decorated functions.

Usage: python tests/mutation/sample.py [SEED SIZE [PACKAGE ...]], from the top of the
repository.
"""

import os
import random
import re
import subprocess
import sys
from itertools import islice
from pathlib import Path

import pandas as pd
from mutmut.__main__ import _run, collect_or_load_stats, create_file_mutants
from mutmut.configuration import config
from mutmut.mutation.data import SourceFileMutationData
from mutmut.mutation.diff_apply import get_diff_for_mutant
from mutmut.state import state
from mutmut.stats import save_stats, status_by_exit_code
from mutmut.utils.file_utils import (
    copy_also_copy_files,
    copy_src_dir,
    setup_source_paths,
    walk_source_files,
)
from mutmut.utils.format_utils import (
    mangled_name_from_mutant_name,
    orig_function_and_class_names_from_key,
)
from mutmut.workers.isolation import get_mutant_runner
from statsmodels.stats.proportion import proportion_confint

# Time for the tests of one mutant.
SECONDS = 20.0
PACKAGE = Path("src/elastocal")
PACKAGES = (
    "mechanics",
    "study",
    "effects",
    "fitting",
    "data_checks",
    "diagnosis",
    "campaigns",
    "validation",
)
_STRING = re.compile(r""""[^"]*"|'[^']*'""")


def make_mutants():
    """Write all mutants into ``mutants/``. This process does so itself, because mutmut's
    pool waits forever for a worker that was killed."""
    copy_src_dir()
    for path in walk_source_files():
        mutants = create_file_mutants(path)
        if mutants.error:
            raise mutants.error


def read_exit_codes(path):
    """Return the exit codes of the tests of a module's mutants by the names of the
    mutants; None for a mutant that was not tested."""
    data = SourceFileMutationData(path=path)
    data.load()
    return data.exit_code_by_key


def describe_mutant(mutant, path):
    """Return the location and the change of a mutant as columns of the table; None if it
    changes only the text of a string."""
    diff = get_diff_for_mutant(mutant, path=path).splitlines()[3:]
    removed = [line[1:].strip() for line in diff if line.startswith("-")]
    added = [line[1:].strip() for line in diff if line.startswith("+")]
    before = " ".join(removed)
    after = " ".join(added)
    if _STRING.sub("", before) == _STRING.sub("", after):
        return None
    name, owner = orig_function_and_class_names_from_key(mutant)
    source = path.read_text(encoding="utf-8")
    function = source.index(
        f"def {name}(", source.index(f"class {owner}") if owner else 0
    )
    line = source.count("\n", 0, source.index(removed[0], function)) + 1
    module = path.relative_to(PACKAGE)
    return {
        "package": module.parts[0],
        "module": module.as_posix(),
        "line": line,
        "function": f"{owner}.{name}" if owner else name,
        "mutant": mutant,
        "before": before,
        "after": after,
    }


def draw(seed, size):
    """Draw `size` mutants of each package without replacement, as a table with one row a
    mutant."""
    rows = []
    for package in PACKAGES:
        population = [
            (mutant, path)
            for path in sorted(PACKAGE.glob(f"{package}/**/*.py"))
            for mutant in read_exit_codes(path)
        ]
        random.Random(f"{seed} {package}").shuffle(population)
        descriptions = (describe_mutant(mutant, path) for mutant, path in population)
        rows += islice(filter(None, descriptions), size)
    return pd.DataFrame(rows)


def run(mutants, package):
    """Test mutants of one package by the tests of the package that cover them, from the
    fastest one on, up to `SECONDS` for a mutant."""
    config().pytest_add_cli_args_test_selection = [f"tests/{package}"]
    Path("mutants/mutmut-stats.json").unlink(missing_ok=True)
    durations = state().duration_by_test
    covering = state().tests_by_mangled_function_name
    durations.clear()
    covering.clear()
    collect_or_load_stats(get_mutant_runner())
    for function in {mangled_name_from_mutant_name(mutant) for mutant in mutants}:
        tests = pd.Series(
            {test: state().duration_by_test[test] for test in covering[function]},
            dtype=float,
        ).sort_values()
        covering[function] = set(tests.index[:1]) | set(
            tests.index[tests.cumsum() <= SECONDS]
        )
    save_stats()
    _run(mutants, max_children=1)


def is_detected_by_the_study(mutant):
    """Return whether a mutant changes the golden tables of the small study."""
    command = [
        sys.executable,
        "-m",
        "pytest",
        "-q",
        "-x",
        "--slow",
        "all",
        "-k",
        "what_it_was",
    ]
    command.append("tests/workflow/test_reproducibility.py")
    environment = os.environ | {"MUTANT_UNDER_TEST": mutant}
    return (
        subprocess.run(
            command, cwd="mutants", env=environment, capture_output=True
        ).returncode
        == 1
    )


def compute_scores(sample):
    """Compute the share of mutants that the tests detect, with Wilson's 95 % interval, for
    each package and for all."""
    rows = []
    for package, mutants in [*sample.groupby("package", sort=False), ("all", sample)]:
        detected = mutants["status"].isin(["killed", "timeout"]).sum()
        low, high = proportion_confint(detected, len(mutants), method="wilson")
        counts = {
            status: (mutants["status"] == status).sum()
            for status in sample["status"].unique()
        }
        rows.append(
            {"package": package}
            | counts
            | {"score": detected / len(mutants), "low": low, "high": high}
        )
    return pd.DataFrame(rows)


def evaluate_mutants(package, mutants):
    """Test the mutants of one package, and return their table with a column of
    statuses."""
    run(list(mutants["mutant"]), package)
    codes = {}
    for module in mutants["module"].unique():
        codes |= read_exit_codes(PACKAGE / module)
    statuses = [status_by_exit_code[codes[mutant]] for mutant in mutants["mutant"]]
    mutants = mutants.assign(status=statuses)
    if package == "study":
        uncovered = mutants["mutant"][mutants["status"] == "no tests"]
        if len(uncovered) and is_detected_by_the_study(""):
            raise AssertionError(
                "the golden tables of the small study are others without any mutant"
            )
        killed = [
            index
            for index, mutant in uncovered.items()
            if is_detected_by_the_study(mutant)
        ]
        mutants.loc[killed, "status"] = "killed"
    return mutants


if __name__ == "__main__":
    seed, size = map(int, sys.argv[1:3]) if sys.argv[1:] else (1, 25)
    make_mutants()
    sample = draw(seed, size)
    sample = sample[sample["package"].isin(sys.argv[3:] or sample["package"])]
    copy_also_copy_files()
    setup_source_paths()
    tested = []
    for package, mutants in sample.groupby("package", sort=False):
        tested.append(evaluate_mutants(package, mutants))
        pd.concat(tested).to_csv("reports/mutants.csv", index=False)
    print(compute_scores(pd.concat(tested)).round(2).to_string(index=False))
