"""Runs, their scores, and the command line."""
