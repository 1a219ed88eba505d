"""The report of the study: what its text says in numbers, and the pages."""
