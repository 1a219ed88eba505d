"""What a fitted model is good for: predicted poses, corrected joint targets, planned
measurements, statements of accuracy."""
