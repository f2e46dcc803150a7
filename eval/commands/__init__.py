"""The commands of ``roomloop`` that are more than a few lines, one module each."""
