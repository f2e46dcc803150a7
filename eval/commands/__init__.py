"""Commands of their own file, registered in ``eval.cli``."""
