"""The report of the blind proof as PDF: facts and sentences for the Typst template that stands beside them."""
