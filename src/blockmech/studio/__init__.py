"""The studio: a page in the browser on which mechanisms are wired, seen and saved."""
