"""A physical robot to be blind about: MuJoCo statics with defects, its tracker, its load cell, and the campaigns made with it.

Nothing here shares kinematic, elastic or statistical code with the analysis. Of elastocal only `errors` is imported, so that an
agreement of the two is a finding and not the same line of code run twice. The
laws of the defects are on purpose not those of the catalogue: what the analysis fits is never exactly what was done.
"""

from elastocal_proof.plant import laws  # noqa: F401 - it enters its defects into the table of kinds
