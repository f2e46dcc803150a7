"""Pages to read: one HTML file a run or an ablation, whole in itself, on paper, screen or phone."""
