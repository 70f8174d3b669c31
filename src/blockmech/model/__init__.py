"""The graph and its file: wiring, checks, structure, scene and laws of motion."""
