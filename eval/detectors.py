"""Detectors and odometries by name, ours and a user's ``package.module:Class``.

The tables load nothing by themselves: a part is imported when it is made.
"""

from __future__ import annotations

import importlib
import os
import sys
from collections.abc import Callable, Mapping
from functools import partial
from typing import TYPE_CHECKING, Any, NoReturn

from eval.names import known, refuse

if TYPE_CHECKING:
    from eval.labels import TruthKeeper
    from slam.core import Detector, MapView, Odometry, Proposals


class NoDetector:
    """Finds nothing: planes only, and what a run costs without a detector."""

    def update(self, view: MapView) -> Proposals:
        """No rooms, no walls."""
        from slam.core import Proposals

        return Proposals()


def _trained(name: str) -> Callable[[TruthKeeper | None], Detector]:
    def make(_: TruthKeeper | None) -> Detector:
        from semantics.detector import make_detector
        from semantics.storeys import by_storey

        return by_storey(partial(make_detector, name))

    return make


def _hydra(name: str) -> Callable[[TruthKeeper | None], Detector]:
    def make(_: TruthKeeper | None) -> Detector:
        from semantics.hydra.config import PRESETS
        from semantics.hydra.detector import HydraDetector
        from semantics.storeys import by_storey

        return by_storey(partial(HydraDetector, PRESETS[name]))

    return make


def _sgraphs(name: str) -> Callable[[TruthKeeper | None], Detector]:
    def make(_: TruthKeeper | None) -> Detector:
        from semantics.sgraphs.config import PRESETS
        from semantics.sgraphs.detector import SgraphsDetector
        from semantics.storeys import by_storey

        return by_storey(partial(SgraphsDetector, PRESETS[name]))

    return make


def _oracle(keeper: TruthKeeper | None) -> Detector:
    from eval.oracle import OracleDetector

    if keeper is None:
        refuse("detector: 'oracle' reads the truth, and there is none here")
    return OracleDetector(keeper)


def _kiss() -> Odometry:
    from slam.kiss import KissOdometry

    return KissOdometry()


def _kiss_wheels() -> Odometry:
    from slam.kiss import KissConfig, KissOdometry

    return KissOdometry(KissConfig(wheels=True))


def _kiss_published() -> Odometry:
    from slam.kiss import PublishedKissOdometry

    return PublishedKissOdometry()


def _vgicp() -> Odometry:
    from slam.vgicp import VgicpOdometry

    return VgicpOdometry()


DETECTORS: Mapping[str, Callable[[TruthKeeper | None], Detector]] = {
    "gnn": _trained("gnn"),
    "gnn-greedy": _trained("gnn-greedy"),
    "paper": _trained("paper"),
    "paper-greedy": _trained("paper-greedy"),
    "hydra": _hydra("hydra"),
    "hydra-v1": _hydra("hydra-v1"),
    "hydra-tuned": _hydra("hydra-tuned"),
    "sgraphs": _sgraphs("sgraphs"),
    "sgraphs-faults": _sgraphs("sgraphs-faults"),
    "sgraphs-tuned": _sgraphs("sgraphs-tuned"),
    "oracle": _oracle,
    "none": lambda _: NoDetector(),
}
ODOMETRIES: Mapping[str, Callable[[], Odometry]] = {
    "kiss": _kiss,
    "kiss-wheels": _kiss_wheels,
    "kiss-published": _kiss_published,
    "vgicp": _vgicp,
}


def make_detector(name: str, keeper: TruthKeeper | None = None) -> Detector:
    """A new detector, by its name or as ``package.module:Class``. Raises InputError.

    keeper: the run's truth, which only the oracle is given.
    """
    check_name("detector", name, DETECTORS)
    if name in DETECTORS:
        return DETECTORS[name](keeper)
    return _plugin("detector", name, "update")


def make_odometry(name: str) -> Odometry:
    """A new odometry, by its name or as ``package.module:Class``. Raises InputError."""
    check_name("odometry", name, ODOMETRIES)
    return ODOMETRIES[name]() if name in ODOMETRIES else _plugin("odometry", name, "register")


def check_name(what: str, name: str, names: Mapping[str, object]) -> None:
    """InputError unless the name is in the table or looks like ``package.module:Class``."""
    if ":" not in name:
        known(what, name, names)
    elif not all(part.isidentifier() for part in name.replace(":", ".").split(".")):
        refuse(f"{what}: {name!r}: expected package.module:Class")


def _plugin(what: str, name: str, method: str) -> Any:
    """An instance of a user's class. Raises InputError unless it has the method."""
    made = _call(what, name, _load(what, name))
    if not callable(getattr(made, method, None)):
        refuse(f"{what}: {name!r} has no method {method}()")
    return made


def _load(what: str, name: str) -> Callable[[], Any]:
    """The class behind ``package.module:Class``; the working folder is searched last."""
    module_name, _, class_name = name.partition(":")
    if os.getcwd() not in sys.path:
        sys.path.append(os.getcwd())
    try:
        module = importlib.import_module(module_name)
    except Exception as error:
        _refuse_because(what, f"importing {module_name} failed", error)
    made = getattr(module, class_name, None)
    if not callable(made):
        refuse(f"{what}: {module_name} has no class {class_name!r}")
    return made


def _call(what: str, name: str, factory: Callable[[], Any]) -> Any:
    try:
        return factory()
    except TypeError as error:
        _refuse_because(what, f"{name}() cannot be made without arguments", error)


def _refuse_because(what: str, message: str, error: Exception) -> NoReturn:
    from slam.core import InputError

    raise InputError(f"{what}: {message}: {type(error).__name__}: {error}") from error
