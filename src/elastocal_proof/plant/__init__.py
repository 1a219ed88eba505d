"""A simulated robot for the blind benchmark: MuJoCo statics with defects, its laser
tracker, its load cell, and the campaigns measured with them.

The package imports nothing of elastocal but `errors`, and its defects follow other laws
than the effects of the catalogue. If the analysis agrees with the simulation, this is a
result and not the same line of code run twice.
"""
