"""What a real spinning LiDAR's recording says about it, and what a preset would have recorded."""
