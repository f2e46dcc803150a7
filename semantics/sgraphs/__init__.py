"""The room segmentation of S-Graphs+ (Bavle et al. 2023): free-space clusters and their planes."""
