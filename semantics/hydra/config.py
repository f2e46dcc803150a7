"""Hydra's parameters: the published ones by default (uhumans2, with its 16-beam sensor model)."""

from __future__ import annotations

from dataclasses import dataclass, field

from semantics.freespace.gvd import GvdConfig
from semantics.freespace.places import PlacesConfig
from semantics.freespace.space import SpaceConfig
from semantics.freespace.tsdf import TsdfConfig


@dataclass(frozen=True)
class RoomsConfig:
    """From places to rooms.

    version 2 (IJRR 2024): exact edge filtration, plateau rule, widest-path growing; version 1 (RSS
    2022): ``steps`` dilations between, median count, modularity. min_dilation, max_dilation [m];
    min_component, min_room: places; plateau_ratio: of the longest lifetime; repeated: the count
    that most edges in a row have instead (the rule of the struct's defaults); sweeps, gamma: of the
    modularity.
    """

    version: int = 2
    min_dilation: float = 0.5
    max_dilation: float = 1.2
    min_component: int = 10
    min_room: int = 10
    plateau_ratio: float = 0.15
    repeated: bool = False
    steps: int = 10
    sweeps: int = 5
    gamma: float = 1.0


@dataclass(frozen=True)
class HydraConfig:
    """The whole detector; period: rooms are found anew every so many seconds [s]. Scored is the
    last word, which is on the whole map."""

    space: SpaceConfig = field(default_factory=SpaceConfig)
    rooms: RoomsConfig = field(default_factory=RoomsConfig)
    period: float = 10.0


PUBLISHED_V2 = HydraConfig()
PUBLISHED_V1 = HydraConfig(
    rooms=RoomsConfig(version=1, min_dilation=0.43, max_dilation=1.2, min_room=1)
)
TUNED = HydraConfig(
    space=SpaceConfig(
        tsdf=TsdfConfig(coarser=1),
        gvd=GvdConfig(parents_cosine=0.5),
        places=PlacesConfig(compression=0.5, merge=0.1, by_clearance=True),
    ),
    rooms=RoomsConfig(min_component=5, min_dilation=0.6, max_dilation=0.8, plateau_ratio=0.5),
)
"""Best for a 16-beam sensor on generated buildings (``roomloop bench baselines``): of 1.5 m
cells, a room of 3 x 4 m has fewer than the 10 places that it needs."""

PRESETS = {"hydra": PUBLISHED_V2, "hydra-v1": PUBLISHED_V1, "hydra-tuned": TUNED}
