"""Hydra's room segmentation (Hughes et al., RSS 2022, IJRR 2024): a detector without planes."""
