"""The moving base: a disc on a differential drive, with a sprung body that carries the LiDAR."""

from __future__ import annotations

from dataclasses import dataclass, field
from math import cos, exp, sin, sqrt
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from sim.wheels import WheelConfig, Wheels
from slam.core import Array, InputError, RunError

if TYPE_CHECKING:
    import mujoco

    from sim.ground import Ground

JOINTS = ("base_x", "base_y", "base_yaw", "base_heave", "base_roll", "base_pitch")
"""In the order of the columns of what ``Base.coordinates`` gives."""


@dataclass(frozen=True)
class BaseConfig:
    """A small indoor robot. Limits are what the drive is allowed, not what it could.

    radius, z_low, z_high: collision cylinder [m], clear of the floor; mass [kg] of chassis and of
    the sprung body, whose centre is ``sprung_height`` [m] above the floor; natural frequencies
    [Hz] and damping ratio of the suspension; road_height [m] and road_tilt [rad]: sigma of what the
    floor's unevenness does to it, over a correlation length of ``road_length`` [m]; speed [m/s],
    acceleration [m/s2], jerk [m/s3] and the same of turning, turn_rate [rad/s], turn_acceleration
    [rad/s2], turn_jerk [rad/s3]; lidar_height [m] above the floor; wheels: what carries the base;
    timestep [s] of the physics.
    """

    radius: float = 0.20
    z_low: float = 0.10
    z_high: float = 0.60
    chassis_mass: float = 20.0
    sprung_mass: float = 10.0
    sprung_height: float = 0.35
    heave_frequency: float = 3.0
    tilt_frequency: float = 2.0
    damping_ratio: float = 0.25
    road_height: float = 0.001
    road_tilt: float = 0.0045
    road_length: float = 0.30
    speed: float = 0.6
    acceleration: float = 0.5
    jerk: float = 3.0
    turn_rate: float = 0.8
    turn_acceleration: float = 2.0
    turn_jerk: float = 20.0
    lidar_height: float = 0.50
    timestep: float = 0.005
    wheels: WheelConfig = field(default_factory=WheelConfig)

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if name == "wheels":
                continue
            least = 0.0 if name.startswith("road_") and name != "road_length" else 1e-9
            if not (np.isfinite(value) and value >= least):
                raise InputError(f"base: {name} is {value}, expected a positive number")
        if self.wheels.grip < self.timestep:
            raise InputError(
                f"base: wheels.grip is {self.wheels.grip} s, expected the physics step of "
                f"{self.timestep} s or more"
            )

    @property
    def mass(self) -> float:
        """Of chassis and sprung body [kg]."""
        return self.chassis_mass + self.sprung_mass

    @property
    def T_base_lidar(self) -> Array:
        """(4, 4) where the LiDAR sits on the base."""
        T = np.eye(4)
        T[2, 3] = self.lidar_height
        return T


class Base:
    """The base in a compiled copy of a building's ``spec``, standing at (x, y, yaw) on ``z_floor``.

    The base frame lies at floor level in the middle of the disc and moves with the sprung body.
    ``rng`` draws the unevenness of the floor, and the wheels. ``ground`` (None: level) carries it
    up ramps, where it drives and counts the way as seen in plan.
    """

    def __init__(
        self,
        spec: mujoco.MjSpec,
        z_floor: float,
        start: tuple[float, float, float],
        config: BaseConfig,
        rng: np.random.Generator,
        ground: Ground | None = None,
    ) -> None:
        import mujoco

        self.config = config
        self.z_floor = z_floor
        self._ground = ground
        self._rng = rng
        self._road = [0.0, 0.0, 0.0]
        self._mujoco_step = mujoco.mj_step
        self.model = _with_base(spec, z_floor, config).compile()
        self.data = mujoco.MjData(self.model)
        self.wheels = Wheels(config.wheels, config.mass, config.timestep, rng)
        self._disc = int(self.model.geom("base_disc").id)
        self._chassis = int(self.model.body("base_chassis").id)
        self._qpos = [int(self.model.joint(name).qposadr[0]) for name in JOINTS]
        self._dofs = [int(self.model.joint(name).dofadr[0]) for name in JOINTS]
        self._stiffness = [float(self.model.joint(name).stiffness[0]) for name in JOINTS[3:]]
        self.data.qpos[self._qpos[:3]] = start
        mujoco.mj_forward(self.model, self.data)

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        return float(self.data.time)

    @property
    def coordinates(self) -> Array:
        """(6,) x, y, yaw, heave, roll, pitch now; heave above ``z_floor``, up ramps too."""
        coordinates: Array = self.data.qpos[self._qpos]
        coordinates[3] += self.model.body_pos[self._chassis, 2] - self.z_floor
        return coordinates

    def geom_ids(self, names: tuple[str, ...]) -> NDArray[np.int32]:
        """(G,) MuJoCo's ids of the named geoms in the compiled model."""
        return np.array([self.model.geom(name).id for name in names], dtype=np.int32)

    def step(self, speed: float, turn_rate: float) -> None:
        """One physics step with the wheels asked for ``speed`` [m/s] and ``turn_rate`` [rad/s].

        Raises RunError when the disc touches a wall.
        """
        if self._ground is not None:
            self._stand_on(self._ground)
        yaw = float(self.data.qpos[self._qpos[2]])
        vx, vy, turning = self.data.qvel[self._dofs[:3]].tolist()
        c, s = cos(yaw), sin(yaw)
        ahead, aside = c * vx + s * vy, c * vy - s * vx
        forwards, left, moment = self.wheels.push(speed, turn_rate, (ahead, aside, turning))
        asked = self._unevenness(self.wheels.way(speed, turn_rate))
        self.data.qfrc_applied[self._dofs] = (
            c * forwards - s * left,
            s * forwards + c * left,
            moment,
            *(k * height for k, height in zip(self._stiffness, asked, strict=True)),
        )
        self._mujoco_step(self.model, self.data)
        if self.data.ncon:
            self._refuse_contact()

    def _stand_on(self, ground: Ground) -> None:
        """Lifts the chassis to the ground, and has the springs rest at its slope."""
        height, *tilt = ground.under(*self.data.qpos[self._qpos[:3]].tolist())
        self.model.body_pos[self._chassis, 2] = height
        self.model.qpos_spring[self._qpos[4:]] = tilt

    def _unevenness(self, way: float) -> list[float]:
        """Heave [m], roll and pitch [rad] that the floor asks for after ``way`` [m] on it.

        Ornstein-Uhlenbeck in the distance travelled: a base that stands is not shaken.
        """
        config = self.config
        memory = exp(-way / config.road_length)
        kick = sqrt(1.0 - memory * memory)
        sigmas = (config.road_height, config.road_tilt, config.road_tilt)
        draws = self._rng.standard_normal(3).tolist()
        self._road = [
            memory * height + kick * sigma * draw
            for height, sigma, draw in zip(self._road, sigmas, draws, strict=True)
        ]
        return self._road

    def _refuse_contact(self) -> None:
        """Raises RunError if the disc touches anything: it is clear of the floor, so it is a wall.

        What else may move in the building is free to touch what it likes.
        """
        for geoms in self.data.contact.geom.tolist():
            if self._disc not in geoms:
                continue
            touched = geoms[0] if geoms[1] == self._disc else geoms[1]
            name = self.model.geom(touched).name or f"geom {touched}"
            x, y = self.coordinates[:2]
            raise RunError(
                f"the base touched a wall at t={self.time:.2f} s, x={x:.2f}, y={y:.2f} ({name})"
            )


def base_poses(coordinates: Array, z_floor: float) -> Array:
    """T_world_base (K, 4, 4) of coordinates (K, 6): x, y, yaw, heave, roll, pitch."""
    x, y, yaw, heave, roll, pitch = np.asarray(coordinates, dtype=np.float64).T
    cy, sy, cr, sr = np.cos(yaw), np.sin(yaw), np.cos(roll), np.sin(roll)
    cp, sp = np.cos(pitch), np.sin(pitch)
    poses = np.zeros((len(x), 4, 4))
    poses[:, 0, :3] = np.stack([cy * cp - sy * sr * sp, -sy * cr, cy * sp + sy * sr * cp], axis=1)
    poses[:, 1, :3] = np.stack([sy * cp + cy * sr * sp, cy * cr, sy * sp - cy * sr * cp], axis=1)
    poses[:, 2, :3] = np.stack([-cr * sp, sr, cr * cp], axis=1)
    poses[:, :3, 3] = np.stack([x, y, z_floor + heave], axis=1)
    poses[:, 3, 3] = 1.0
    return poses


def _with_base(spec: mujoco.MjSpec, z_floor: float, config: BaseConfig) -> mujoco.MjSpec:
    """A copy of the building with the base in it."""
    import mujoco

    spec = spec.copy()
    spec.option.timestep = config.timestep
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    chassis = spec.worldbody.add_body(name="base_chassis", pos=[0.0, 0.0, z_floor])
    _planar_joints(chassis)
    half = 0.5 * (config.z_high - config.z_low)
    chassis.add_geom(
        name="base_disc",
        type=mujoco.mjtGeom.mjGEOM_CYLINDER,
        size=[config.radius, half, 0.0],
        pos=[0.0, 0.0, config.z_low + half],
        mass=config.chassis_mass,
        contype=1,
        conaffinity=1,
    )
    _sprung_body(chassis, config)
    return spec


def _planar_joints(chassis: mujoco.MjsBody) -> None:
    import mujoco

    slide, hinge = mujoco.mjtJoint.mjJNT_SLIDE, mujoco.mjtJoint.mjJNT_HINGE
    chassis.add_joint(name="base_x", type=slide, axis=[1.0, 0.0, 0.0])
    chassis.add_joint(name="base_y", type=slide, axis=[0.0, 1.0, 0.0])
    chassis.add_joint(name="base_yaw", type=hinge, axis=[0.0, 0.0, 1.0])


def _sprung_body(chassis: mujoco.MjsBody, config: BaseConfig) -> None:
    """Heave, roll and pitch on springs; weight is carried, so that it rests level."""
    import mujoco

    sprung = chassis.add_body(name="base", gravcomp=1.0)
    sprung.mass = config.sprung_mass
    sprung.ipos = [0.0, 0.0, config.sprung_height]
    sprung.inertia = [0.05 * config.sprung_mass] * 3
    sprung.explicitinertial = True
    about_floor = (0.05 + config.sprung_height**2) * config.sprung_mass
    slide, hinge = mujoco.mjtJoint.mjJNT_SLIDE, mujoco.mjtJoint.mjJNT_HINGE
    for name, kind, axis, inertia, frequency in (
        ("base_heave", slide, [0.0, 0.0, 1.0], config.sprung_mass, config.heave_frequency),
        ("base_roll", hinge, [1.0, 0.0, 0.0], about_floor, config.tilt_frequency),
        ("base_pitch", hinge, [0.0, 1.0, 0.0], about_floor, config.tilt_frequency),
    ):
        omega = 2.0 * np.pi * frequency
        joint = sprung.add_joint(name=name, type=kind, axis=axis)
        joint.stiffness[0] = inertia * omega**2
        joint.damping[0] = 2.0 * config.damping_ratio * inertia * omega
    sprung.add_site(name="lidar", pos=[0.0, 0.0, config.lidar_height])
