"""What a fitted model lacks: from sufficient statistics to probabilities, an alarm, a verdict, a refit and the next experiment.

Read from top to bottom: `settings`; `hypotheses` (mechanisms at locations) and `other` (a smooth random competitor);
`statistics` (all that the measurements say, in a few hundred numbers; `summed` where there are too many to be held) and
`linearize`, which makes them of a fit; `evidence` (Bayes factors), `search` (posterior), `alarm`, `verdict`; `refit` and
`averaging` of parameters; `findings`, with `confounding`; and the two calls `diagnose` and `judge`. Then
the next experiment: `new_states`, `alternatives`, `promise`, `proposal`, `next_experiment`.

Imports `fitting`, `data_checks`, `validation` and what these import.
"""
