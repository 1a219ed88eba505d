"""Lists that are written from the catalogue of effects: the candidates on the FANUC,
which a test compares with the catalogue, and the table of sizes in docs/method.md.

`make catalogue` writes both. Neither contains effects of other installed packages.
"""

import re
from pathlib import Path

import yaml
from synthetic import equipped

from elastocal.campaigns.reading import read_robot
from elastocal.effects.catalogue import list_bundled_effects

ROOT = Path(__file__).resolve().parents[2]
TESTS = ROOT / "tests" / "effects"
CANDIDATES = TESTS / "catalogue_on_fanuc.yaml"
METHOD = ROOT / "docs" / "method.md"
# The table of sizes, between the lines that begin and end its fold on the page.
SIZES = re.compile(r"(<details>.*?\n\n)(\|.*?\n)(\n</details>)", re.DOTALL)
HEAD = (
    "| effect, quantity | reference size | times | sign | at most | reason |\n"
    "|---|---|---|---|---|---|\n"
)


def has_own_test(effect):
    """Return whether a test file named after the module of an effect compares it with a
    closed form."""
    module = effect.listed.__module__.rpartition(".")[2]
    test = TESTS / f"test_{module}.py"
    text = test.read_text(encoding="utf-8") if test.is_file() else ""
    return re.search(rf"check_closed_form\(\s*{effect.name}\b", text) is not None


def listed_candidates():
    """Return family and candidates on the FANUC of each effect of the catalogue; a
    candidate has its parameters by its key."""
    sites = equipped(read_robot(ROOT / "config" / "robots" / "fanuc.yaml").chain)
    listed = {}
    for name, effect in list_bundled_effects().items():
        parameters = {}
        for candidate in effect.candidates(sites):
            names = [parameter.name for parameter in candidate.parameters]
            parameters[candidate.key] = names
        listed[name] = {"family": effect.family, "candidates": parameters}
    return listed


def size_lines(effect):
    """Return the rows of the table of sizes for one effect."""
    signs = {-1: "-", 0: "", 1: "+"}
    return [
        f"| {effect.name}, {size.quantity} | {size.share:g} | {size.of} |"
        f" {signs[size.sign]} | {size.most:g} | {size.reason} |"
        for size in effect.sizes.values()
    ]


def write_lists():
    """Write both lists."""
    note = "# Written by `make catalogue`: the effects and their candidates on the FANUC.\n"
    text = yaml.safe_dump(
        listed_candidates(), sort_keys=False, width=10_000, default_flow_style=None
    )
    CANDIDATES.write_text(note + text, encoding="utf-8")
    lines = [
        f"{line}\n"
        for effect in list_bundled_effects().values()
        for line in size_lines(effect)
    ]
    page = METHOD.read_text(encoding="utf-8")
    table = HEAD + "".join(lines)
    page = SIZES.sub(lambda match: f"{match[1]}{table}{match[3]}", page, count=1)
    METHOD.write_text(page, encoding="utf-8")


if __name__ == "__main__":
    write_lists()
