"""A floor plan as a MuJoCo world, and its exact truth."""
