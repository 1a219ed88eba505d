"""Pictures of the catalogue for the site: how each effect displaces a measured point.

`snakemake -j1 signatures`. Writes reports/figures/signatures/EFFECT.svg.
"""


rule draw_signatures:
    input:
        # This robot has a compensator and a rated load, which some effects need.
        robot=f"{CONFIG}/robots/gp180.yaml",
    output:
        figures=directory("reports/figures/signatures"),
    script:
        "../scripts/draw_signatures.py"


rule signatures:
    input:
        rules.draw_signatures.output,
