"""Paper, colours, panels of curves, and answers with a picture: what all pictures are made of."""
