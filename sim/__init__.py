"""A LiDAR on a moving base in a world; yields scans and, apart from them, their truth."""
