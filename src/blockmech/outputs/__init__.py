"""Outputs and sensors, by block and by link."""
