"""The blind proof: cases with sealed ground truth made on the plant, and what the
verdicts on them are worth.

The only room that imports `plant`; beside it `loop` and what that imports.
"""
