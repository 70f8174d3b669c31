"""Links and pairs without lengths: generic rank, Assur groups, what is wrong with a structure."""
