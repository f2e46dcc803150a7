"""A run to look at: its scene graph as a rerun recording, live or in a file, and as a page."""
