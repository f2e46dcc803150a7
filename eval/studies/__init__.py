"""What the choices of detectors, odometry and sensor model are made from."""
