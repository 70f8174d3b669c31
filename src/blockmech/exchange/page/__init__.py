"""A mechanism as one page that needs no server: its plan as JavaScript, a drawing and curves."""
