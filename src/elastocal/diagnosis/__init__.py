"""What a fitted model lacks: from sufficient statistics to probabilities, an alarm, a verdict, a refit and the next experiment.

Read from top to bottom: `settings`; `hypotheses` (mechanisms at locations) and `other` (a smooth random competitor);
`linearize`, the one object of a fit and all that it might lack, and `statistics` of it (all that the measurements say, in a
few hundred numbers); `gross_errors`; `evidence` (Bayes factors), `search` (posterior), `alarm`, `verdict`; `refit` and
`averaging` of parameters; `findings`; and the two calls `diagnose` and `judge`. Then
the `next_experiment`.

Imports `fitting`, `data_checks`, `validation` and what these import.
"""
