"""The blind proof as a page of the documentation."""
