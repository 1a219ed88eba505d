"""The blind benchmark as a page of the documentation."""
