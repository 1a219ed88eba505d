"""The report of a campaign compiles whatever the verdict, and keeps within its margins."""

from importlib import resources

import pytest
import typst
from made_loop_facts import CAMPAIGNS, DIALECT, HARMONICS, facts_of
from made_loop_tables import (
    campaign_descriptions,
    candidate_table,
    confounding_table,
    effect_entry,
    experiment_rows,
    parameter_table,
    probabilities,
    residual_table,
    split_rows,
    step_rows,
    verdict_document,
)
from matplotlib.image import imread

from elastocal.diagnosis.verdict import CLASS
from elastocal.effects.catalogue import effects
from elastocal.figures import candidates as of_candidates
from elastocal.figures.before_after import before_after
from elastocal.figures.residuals import arrows, residuals
from elastocal.figures.style import save
from elastocal.report.loop_pages import write_loop_report


@pytest.fixture(scope="module")
def pictures(tmp_path_factory):
    folder, table, candidates = tmp_path_factory.mktemp("figures"), residual_table(), candidate_table()
    drawn = {
        "before_after": before_after(step_rows(), 5e-5),
        "arrows": arrows(table),
        "residuals": residuals(table),
        "candidates": of_candidates.probabilities(probabilities(), candidates),
        "confounding": of_candidates.confounding(candidates, confounding_table(candidates)),
    }
    for name, figure in drawn.items():
        save(figure, str(folder / f"{name}.pdf"), str(folder / f"{name}.png"))
    return [str(folder / f"{name}.pdf") for name in drawn]


@pytest.fixture
def pages(monkeypatch):
    """The pages of every report that is compiled, as pixels too."""
    seen, compiled = [], typst.compile

    def compile_both(source, output, format, root):
        # More than one page needs a pattern to write to.
        compiled(source, output=f"{root}/page-{{0p}}.png", format="png", root=root, ppi=60)
        seen.extend(imread(file) for file in sorted(source.parent.glob("page-*.png")))
        return compiled(source, output=output, format=format, root=root)

    monkeypatch.setattr(typst, "compile", compile_both)
    return seen


@pytest.mark.parametrize("campaign", CAMPAIGNS)
def test_every_verdict_compiles_within_its_margins(campaign, pictures, pages, tmp_path):
    path = tmp_path / "report.pdf"
    write_loop_report(str(path), facts_of(CAMPAIGNS[campaign]), pictures)
    assert path.read_bytes().startswith(b"%PDF")
    assert_within_margins(pages)


def test_long_names_wrap(pictures, pages, tmp_path):
    long = "a_campaign_with_a_name_that_nobody_would_type_twice_but_that_a_script_made_" + "x1_" * 20
    effect = effect_entry(parameters=["compliance_times_mass_at_end_of_link_" + "and_of_another_" * 8])
    effect["alternatives"] = sorted(effects())
    verdict = verdict_document(
        CLASS, [effect], [f"{long}: is a long name"], campaign=long, held=[f"link_geometry@{k} dx" for k in range(1, 7)]
    )
    changed = {
        "descriptions": campaign_descriptions(
            long, f"{long} robot", f"{long}_static", targets=[f"target_{k}_of_a_long_bar" for k in range(2)]
        ),
        "steps": step_rows(["lost_motion", ", ".join(HARMONICS[:5])]),
        "experiment": experiment_rows() + experiment_rows("transmission_harmonic"),
        "parameters": parameter_table(
            [f"link_geometry@{k} {name}" for k in range(1, 9) for name in ("dx", "dy", "dz", "rx", "ry", "rz")]
        ),
        "splits": split_rows(blocks=12),
    }
    write_loop_report(str(tmp_path / "report.pdf"), facts_of(verdict, **changed), pictures)
    assert_within_margins(pages)


def test_a_rerun_gives_the_same_bytes(pictures, tmp_path):
    for run in "ab":
        write_loop_report(str(tmp_path / f"{run}.pdf"), facts_of(CAMPAIGNS["class"], experiment=experiment_rows()), pictures)
    assert (tmp_path / "a.pdf").read_bytes() == (tmp_path / "b.pdf").read_bytes()


def test_the_pages_speak_no_private_dialect():
    source = resources.files("elastocal.report").joinpath("loop.typ").read_text(encoding="utf-8")
    assert not [line for line in source.splitlines() if DIALECT.search(line)]


def assert_within_margins(pages):
    assert pages
    for page in pages:
        width = page.shape[1]
        # Margins of 22 mm on a page of 210 mm; a little of it for the edges of letters.
        margin = int(width * 20 / 210)
        assert (page[:, :margin, :3] > 0.99).all() and (page[:, -margin:, :3] > 0.99).all()
