"""Odometry, planes, plane map and layered factor graph. Knows nothing of the simulator."""
