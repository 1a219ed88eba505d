"""Mutation testing of a random sample: how often do the tests notice a small fault in
the code?

mutmut makes the mutants and says which tests of the same room cover them. Steps of the
study that none of these runs are run by the small study, whose golden tables are their
tests. Left out are mutants that only change the text of a string, annotations, and what
mutmut never changes: code outside functions, and decorated functions.

Usage: python tests/mutation/sample.py [SEED SIZE [ROOM ...]], from the top of the
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

SECONDS = 20.0
PACKAGE = Path("src/elastocal")
ROOMS = (
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
    """Write all mutants into ``mutants/``; in this process, for mutmut's pool waits
    forever for a worker that was killed."""
    copy_src_dir()
    for path in walk_source_files():
        made = create_file_mutants(path)
        if made.error:
            raise made.error


def exit_codes(path):
    """Exit codes of the tests of a module's mutants by the mutants' names; None for one
    that has not run."""
    data = SourceFileMutationData(path=path)
    data.load()
    return data.exit_code_by_key


def described(mutant, path):
    """Where and what a mutant changes, as columns of the table; None where it is only
    the text of a string."""
    diff = get_diff_for_mutant(mutant, path=path).splitlines()[3:]
    before, after = (
        [line[1:].strip() for line in diff if line.startswith(sign)] for sign in "-+"
    )
    if _STRING.sub("", " ".join(before)) == _STRING.sub("", " ".join(after)):
        return None
    name, owner = orig_function_and_class_names_from_key(mutant)
    source = path.read_text(encoding="utf-8")
    function = source.index(
        f"def {name}(", source.index(f"class {owner}") if owner else 0
    )
    line = source.count("\n", 0, source.index(before[0], function)) + 1
    module = path.relative_to(PACKAGE)
    where = {"room": module.parts[0], "module": module.as_posix(), "line": line}
    what = {"function": f"{owner}.{name}" if owner else name, "mutant": mutant}
    return where | what | {"before": " ".join(before), "after": " ".join(after)}


def draw(seed, size):
    """Draw `size` mutants of each room without replacement: a table of one row a
    mutant."""
    rows = []
    for room in ROOMS:
        population = [
            (mutant, path)
            for path in sorted(PACKAGE.glob(f"{room}/**/*.py"))
            for mutant in exit_codes(path)
        ]
        random.Random(f"{seed} {room}").shuffle(population)
        rows += islice(
            filter(None, (described(mutant, path) for mutant, path in population)), size
        )
    return pd.DataFrame(rows)


def run(mutants, room):
    """Run mutants of one room against those tests of the room that cover them, the
    quickest up to `SECONDS` together."""
    config().pytest_add_cli_args_test_selection = [f"tests/{room}"]
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


def noticed_by_the_study(mutant):
    """Whether the golden tables of the small study, made by the code with a mutant, are
    others."""
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


def scores(sample):
    """Share of mutants that the tests notice, with Wilson's 95 % interval, of each room
    and of all."""
    rows = []
    for room, part in [*sample.groupby("room", sort=False), ("all", sample)]:
        noticed = part["status"].isin(["killed", "timeout"]).sum()
        low, high = proportion_confint(noticed, len(part), method="wilson")
        counts = {
            status: (part["status"] == status).sum()
            for status in sample["status"].unique()
        }
        rows.append(
            {"room": room}
            | counts
            | {"score": noticed / len(part), "low": low, "high": high}
        )
    return pd.DataFrame(rows)


if __name__ == "__main__":
    seed, size = map(int, sys.argv[1:3]) if sys.argv[1:] else (1, 25)
    make_mutants()
    sample = draw(seed, size)
    sample = sample[sample["room"].isin(sys.argv[3:] or sample["room"])]
    copy_also_copy_files()
    setup_source_paths()
    done = []
    for room, part in sample.groupby("room", sort=False):
        run(list(part["mutant"]), room)
        codes = {
            mutant: code
            for module in part["module"].unique()
            for mutant, code in exit_codes(PACKAGE / module).items()
        }
        part = part.assign(
            status=[status_by_exit_code[codes[mutant]] for mutant in part["mutant"]]
        )
        if room == "study":
            alone = part["mutant"][part["status"] == "no tests"]
            if len(alone) and noticed_by_the_study(""):
                raise AssertionError(
                    "the golden tables of the small study are others without any mutant"
                )
            part.loc[
                [
                    place
                    for place, mutant in alone.items()
                    if noticed_by_the_study(mutant)
                ],
                "status",
            ] = "killed"
        done.append(part)
        pd.concat(done).to_csv("reports/mutants.csv", index=False)
    print(scores(pd.concat(done)).round(2).to_string(index=False))
