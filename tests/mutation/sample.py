"""Mutation testing of a random sample: how often do the tests notice a small fault in the code?

mutmut makes the mutants and says which tests cover them. Left out are mutants that only change the text of a
string, annotations, and what mutmut never changes: code outside functions, and decorated functions.

Usage: python tests/mutation/sample.py [SEED SIZE], from the top of the repository.
"""

import random
import re
import sys
from pathlib import Path

import pandas as pd
from mutmut.__main__ import _run, collect_or_load_stats, create_file_mutants
from mutmut.mutation.data import SourceFileMutationData
from mutmut.mutation.diff_apply import get_diff_for_mutant
from mutmut.state import state
from mutmut.stats import save_stats, status_by_exit_code
from mutmut.utils.file_utils import copy_also_copy_files, copy_src_dir, setup_source_paths, walk_source_files
from mutmut.utils.format_utils import mangled_name_from_mutant_name, orig_function_and_class_names_from_key
from mutmut.workers.isolation import get_mutant_runner
from statsmodels.stats.proportion import proportion_confint

SECONDS = 20.0
PACKAGE = Path("src/elastocal")
# The first group that names a module counts.
GROUPS = {
    "elastostatics": ["mechanics/elastostatics.py"],
    "mechanics": ["mechanics/*.py"],
    "identification": ["study/identification.py", "study/strategies.py", "study/gauss_newton.py"],
    "metrics": ["study/metrics.py", "study/evaluation.py", "study/bounds.py", "study/bootstrap.py"],
    **{room: [f"{room}/**/*.py"] for room in ("effects", "fitting", "data_checks", "diagnosis", "campaigns", "validation")},
}
_STRING = re.compile(r""""[^"]*"|'[^']*'""")


def make_mutants():
    """Write all mutants into ``mutants/``; in this process, for mutmut's pool waits forever for a worker that was killed."""
    copy_src_dir()
    for path in walk_source_files():
        made = create_file_mutants(path)
        if made.error:
            raise made.error


def exit_codes(path):
    """Exit codes of the tests of a module's mutants by the mutants' names; None for one that has not run."""
    data = SourceFileMutationData(path=path)
    data.load()
    return data.exit_code_by_key


def described(mutant, path):
    """Where and what a mutant changes, as columns of the table; None where it is only the text of a string."""
    diff = get_diff_for_mutant(mutant, path=path).splitlines()[3:]
    before, after = ([line[1:].strip() for line in diff if line.startswith(sign)] for sign in "-+")
    if _STRING.sub("", " ".join(before)) == _STRING.sub("", " ".join(after)):
        return None
    name, owner = orig_function_and_class_names_from_key(mutant)
    source = path.read_text(encoding="utf-8")
    function = source.index(f"def {name}(", source.index(f"class {owner}") if owner else 0)
    line = source.count("\n", 0, source.index(before[0], function)) + 1
    where = {"module": path.relative_to(PACKAGE).as_posix(), "function": f"{owner}.{name}" if owner else name, "line": line}
    return where | {"mutant": mutant, "before": " ".join(before), "after": " ".join(after)}


def draw(seed, size):
    """Draw `size` mutants of each group without replacement: a table of one row a mutant."""
    rows, seen = [], set()
    for group, patterns in GROUPS.items():
        paths = sorted({path for pattern in patterns for path in PACKAGE.glob(pattern)} - seen)
        seen |= set(paths)
        population = [(mutant, path) for path in paths for mutant in exit_codes(path)]
        random.Random(f"{seed} {group}").shuffle(population)
        drawn = (described(mutant, path) for mutant, path in population)
        rows += [{"group": group} | row for row, _ in zip(filter(None, drawn), range(size), strict=False)]
    return pd.DataFrame(rows)


def shorten_tests(sample):
    """Of the tests that cover a mutant keep what takes `SECONDS` together.

    Tests of the mutant's own module go first, then those of its room, then others, the quickest first.
    """
    durations, covering = state().duration_by_test, state().tests_by_mangled_function_name
    for module, mutant in zip(sample["module"], sample["mutant"], strict=True):
        room, own = f"tests/{Path(module).parent}/", f"tests/{Path(module).parent}/test_{Path(module).name}"
        ranks = {
            test: (not test.startswith(own), not test.startswith(room), durations[test], test)
            for test in covering[mangled_name_from_mutant_name(mutant)]
        }
        tests = pd.Series({test: durations[test] for test in sorted(ranks, key=ranks.get)}, dtype=float)
        covering[mangled_name_from_mutant_name(mutant)] = set(tests.index[:1]) | set(tests.index[tests.cumsum() <= SECONDS])
    save_stats()


def scores(sample):
    """Share of mutants that the tests notice, with Wilson's 95 % interval, of each group and of all."""
    rows = []
    for group, part in [*sample.groupby("group", sort=False), ("all", sample)]:
        noticed = part["status"].isin(["killed", "timeout"]).sum()
        low, high = proportion_confint(noticed, len(part), method="wilson")
        counts = {status: (part["status"] == status).sum() for status in sample["status"].unique()}
        rows.append({"group": group} | counts | {"score": noticed / len(part), "low": low, "high": high})
    return pd.DataFrame(rows)


if __name__ == "__main__":
    seed, size = map(int, sys.argv[1:]) if sys.argv[1:] else (1, 25)
    make_mutants()
    sample = draw(seed, size)
    copy_also_copy_files()
    setup_source_paths()
    collect_or_load_stats(get_mutant_runner())
    shorten_tests(sample)
    _run(list(sample["mutant"]), max_children=1)
    codes = {mutant: code for module in sample["module"].unique() for mutant, code in exit_codes(PACKAGE / module).items()}
    sample["status"] = [status_by_exit_code[codes[mutant]] for mutant in sample["mutant"]]
    sample.to_csv("reports/mutants.csv", index=False)
    print(scores(sample).round(2).to_string(index=False))
