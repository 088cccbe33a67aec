"""Attitude of a stationary base: estimators, their covariance, their error formulas."""
