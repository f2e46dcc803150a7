"""The commands of the command line that are not in ``eval.cli`` itself, one a module."""
