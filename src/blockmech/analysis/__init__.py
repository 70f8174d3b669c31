"""Analyses of a compiled mechanism: limits, extremes, balances, and the trade of speed."""
