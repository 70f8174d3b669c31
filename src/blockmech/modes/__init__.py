"""Assembly modes: every pose in which a group closes, and how they connect."""
