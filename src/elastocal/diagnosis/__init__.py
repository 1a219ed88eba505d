"""What a fitted model lacks: from sufficient statistics to probabilities, an alarm, a
verdict, a refit and the next experiment.

Read from top to bottom: `settings`; `hypotheses` (mechanisms at locations, and a smooth
random competitor); `statistics` (what the measurements say, in a few hundred numbers);
`evidence` (Bayes factors), `search` (posterior and alarm); `linearize`, the one object
of a fit and all that it might lack; `gross_errors`; `refit`, `verdict`; the two calls,
`diagnose` and `judge`; `misplaced`, and the `next_experiment`. Imports `fitting`,
`data_checks`, `validation` and what these import.
"""
