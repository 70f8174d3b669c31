"""Links and joints: the joint-based document, and its decomposition into blocks."""
