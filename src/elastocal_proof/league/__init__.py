"""The league: every method on every public data set, by the same folds; who predicts
poses best that it has not seen."""
