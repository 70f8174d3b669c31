"""Motions integrated in time: right-hand sides, legs, events, and errors by comparison."""
