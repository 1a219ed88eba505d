"""What a fitted model lacks: from sufficient statistics to probabilities, an alarm, a verdict, a refit and the next experiment.

Read from top to bottom: `settings`, `hypotheses` (mechanisms at locations), `other` (a smooth random competitor), `statistics`
(all that the readings say, in a few hundred numbers), `evidence` (Bayes factors), `search` (posterior), `alarm`, `verdict`,
`refit`, and `diagnose` with the two calls `diagnose` and `judge`. May import fitting, effects and what is below; nothing of
the workflow, the plant, figures or reports.
"""
