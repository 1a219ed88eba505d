"""The report of a campaign: figures of its residuals, candidates and errors, and the documents for its user.

Needs results/loop/{campaign}/ and the tables of reports/loop/{campaign}/. Writes reports/loop/{campaign}/figures/*.pdf and *.png,
reports/loop/{campaign}/report.pdf and report.html. It also copies the pictures of the README, including those of the study.
"""

# The campaign whose pictures the README shows.
LOOP_OF_PAGES = "reports/loop/kuka_extended_end_effector"
LOOP_PAGES = ("loop.typ", "sheet.typ", "loop.html", "loop.js", "campaign.txt", "shared.txt")


rule draw_campaign:
    input:
        descriptions=rules.read_campaign.output.descriptions,
        residuals=rules.judge_campaign.output.residuals,
        verdict=rules.judge_campaign.output.verdict,
        before_after=rules.judge_campaign.output.before_after,
        diagnosis=rules.diagnose_campaign.output.diagnosis,
        candidates=rules.diagnose_campaign.output.candidates,
    output:
        pdf=expand("reports/loop/{{campaign}}/figures/{figure}.pdf", figure=[*LOOP_FIGURES]),
        png=[
            shown(
                f"reports/loop/{{campaign}}/figures/{figure}.png",
                f"loop_{figure}",
                "Campaigns",
                campaign="{campaign}",
                shows=shows,
                kind="figure",
            )
            for figure, shows in LOOP_FIGURES.items()
        ],
    params:
        figures=list(LOOP_FIGURES),
    script:
        "../scripts/draw_campaign.py"


rule compile_loop_report:
    input:
        verdict=rules.judge_campaign.output.verdict,
        before_after=rules.judge_campaign.output.before_after,
        residuals=rules.judge_campaign.output.residuals,
        experiment="reports/loop/{campaign}/next_experiment.csv",
        diagnosis=rules.diagnose_campaign.output.diagnosis,
        steps=rules.diagnose_campaign.output.steps,
        descriptions=rules.read_campaign.output.descriptions,
        figures=rules.draw_campaign.output.pdf,
        pages=[placed(PACKAGES / "elastocal/report" / name) for name in LOOP_PAGES],
    output:
        report="reports/loop/{campaign}/report.pdf",
        page=shown(
            "reports/loop/{campaign}/report.html",
            "loop_report",
            "Campaigns",
            campaign="{campaign}",
            shows="The report of the campaign",
            kind="report",
        ),
    script:
        "../scripts/compile_loop_report.py"


rule draw_hero:
    input:
        descriptions=rules.read_campaign.output.descriptions,
        verdict=rules.judge_campaign.output.verdict,
        residuals=rules.judge_campaign.output.residuals,
    output:
        pdf="reports/loop/{campaign}/figures/hero.pdf",
        png=shown(
            "reports/loop/{campaign}/figures/hero.png",
            "loop_hero",
            "Campaigns",
            campaign="{campaign}",
            shows="Arm with its errors before and after",
            kind="figure",
        ),
    script:
        "../scripts/draw_hero.py"


rule draw_sockets:
    """The picture of the pages about calibration without a laser tracker."""
    input:
        descriptions=rules.read_campaign.output.descriptions,
        verdict=rules.judge_campaign.output.verdict,
        residuals=rules.judge_campaign.output.residuals,
    output:
        pdf="reports/loop/{campaign}/figures/sockets.pdf",
        png=shown(
            "reports/loop/{campaign}/figures/sockets.png",
            "loop_hero",
            "Campaigns",
            campaign="{campaign}",
            shows="Ball in its socket before and after",
            kind="figure",
        ),
    script:
        "../scripts/draw_sockets.py"


rule camera_pictures:
    """Picture and tables of docs/no_tracker.md, from a finished `cameras`."""
    input:
        sources=[
            "reports/loop/panda_2_sockets/figures/sockets.png",
            "reports/loop/panda_2_sockets/before_after.csv",
            "reports/loop/fr3_board/before_after.csv",
        ],
    output:
        copies=["docs/no_tracker.png", "docs/panda_2_sockets.csv", "docs/fr3_board.csv"],
    script:
        "../scripts/copy_into_docs.py"


# Files of a finished run by the names of their copies in docs: the pictures of the
# pages, and the tables with which tests compare the numbers on the pages.
COPIES_IN_DOCS = (
    {f"docs/{figure}.png": f"reports/figures/{figure}.png" for figure in FIGURES}
    | {
        f"docs/loop_{figure}.png": f"{LOOP_OF_PAGES}/figures/{figure}.png"
        for figure in ("arrows", "candidates")
    }
    | {
        f"docs/{campaign}.csv": f"reports/loop/{campaign}/before_after.csv"
        for campaign in config["loop"]["main"]
    }
    | {
        "docs/hero.png": f"{LOOP_OF_PAGES}/figures/hero.png",
        "docs/main_campaigns.csv": "reports/loop/main.csv",
        "docs/measured_in_the_box.png": "reports/loop/ur5_every_seventh/figures/before_after.png",
    }
)


rule copy_into_docs:
    input:
        sources=list(COPIES_IN_DOCS.values()),
    output:
        copies=list(COPIES_IN_DOCS),
    script:
        "../scripts/copy_into_docs.py"


# All files in docs that come from the study and the two campaigns.
rule pictures:
    input:
        rules.copy_into_docs.output.copies,
        rules.write_study_page.output.page,
