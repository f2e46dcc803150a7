"""Learned rooms and walls: proximity graph, networks, clustering, training."""
