"""The blind benchmark: cases with sealed ground truth from simulated robots, and scores
of the verdicts on them.

Only this package imports `plant`; of `elastocal` it imports `loop` and the layers
below.
"""
