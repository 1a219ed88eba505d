"""The benchmark of calibration methods: each predicts the same held-out poses of each
public data set."""
