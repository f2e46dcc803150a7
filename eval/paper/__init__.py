"""The paper's tables and figures, measured here, beside its own numbers."""
