"""Code, messages, reports and pages use the words of the field; a word of the private dialect of earlier versions fails."""

import re
from pathlib import Path

import pytest

REPOSITORY = Path(__file__).resolve().parents[1]
SEARCHED = (
    *("README.md", "Snakefile", "config.yaml", "data/README.md", "results/README.md", "reports/README.md"),
    *("config", "docs", "workflow", "src", "benchmarks"),
)
KINDS = {".py", ".smk", ".typ", ".yaml", ".md", ""}
# Each banned word with what is said instead.
GLOSSARY = {
    r"rivals?|weigh(s|ed|ing)? (the )?alternatives": "alternative, compare alternatives",
    r"doubts?|akin": "model departure, a related mechanism",
    r"cannot tell|told from|tell it from": "non-identifiable, distinguishable from, ambiguous",
    r"off the model": "residual subspace, contribution",
    r"tame|wild": "inlier, outlier",
    r"first look|looks?_taken|initial look": "initial screening",
    r"circumstances?": "conditions",
    r"explainable|foreseen": "predictable share, promised",
    r"state_verdict": "verdict, report",
    r"readings?_(of|from)|Readings|readings": "interpretation of the paper; measurement of a tracker",
    r"appearing_whole|whole files": "atomic write",
    r"intake|taken_in": "load, import",
    r"test poses": "validation poses, held-out poses",
}


def lines():
    for name in SEARCHED:
        top = REPOSITORY / name
        for path in sorted(top.rglob("*")) if top.is_dir() else [top]:
            if path.is_file() and path.suffix in KINDS:
                for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1):
                    yield f"{path.relative_to(REPOSITORY)}:{number}", line


@pytest.fixture(scope="module")
def text():
    return list(lines())


@pytest.mark.parametrize("banned", GLOSSARY)
def test_no_word_of_the_private_dialect_comes_back(banned, text):
    pattern = re.compile(rf"(?<![A-Za-z])(?:{banned})(?![A-Za-z])")
    # The name of a random stream cannot change without changing its numbers.
    found = [f"{where}: {line.strip()[:100]}" for where, line in text if pattern.search(line) and "stream(" not in line]
    assert not found, f"say {GLOSSARY[banned]!r}:\n" + "\n".join(found[:20])
