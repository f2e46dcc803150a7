"""Free space as the baselines read it: a distance field from scans, its Voronoi diagram, places."""
