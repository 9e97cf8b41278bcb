"""Gymnasium environments of robots on hobby servos: an SO-101 that reaches, a biped that walks.

`servotwin.robots.gym` gives Gymnasium their names: `gymnasium.make("servotwin.robots.gym:servotwin/SO101Reach-v0")`.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from servotwin.errors import InputError, MissingExtraError, UnknownNameError
from servotwin.models import Model, default_model
from servotwin.models.standing import mid_travel
from servotwin.parameters import Servo, load_servo
from servotwin.parameters.groups import Supply
from servotwin.parameters.registers.held import as_robot_has_it, register_family_of
from servotwin.parameters.registers.table import family_label, set_registers
from servotwin.robots import mjcf_models
from servotwin.robots.camera import Camera, NoDrawingError
from servotwin.robots.drive import ServoDrive
from servotwin.robots.gym import seen
from servotwin.robots.places import load_mujoco
from servotwin.robots.servos.mount import Mount
from servotwin.robots.servos.servo_groups import OF_THE_BUS
from servotwin.robots.trainers.joint_servos import varied
from servotwin.simulation.bus import on_supply
from servotwin.studies.joint import stated
from servotwin.studies.plan import Draw
from servotwin.units import is_finite

try:
    import gymnasium
except ImportError:
    raise MissingExtraError("gymnasium", "robots") from None
if TYPE_CHECKING:
    from servotwin.studies import Distribution

Array = NDArray[np.float64]
Observation = NDArray[np.float32]
PHYSICS_STEP = 0.002  # s: MuJoCo's; feet on gears with play want no longer one (docs/guide/trainers.md)
CABLE = 0.1  # ohm of battery or adapter, cable and plugs, assumed
_TURN = 2.0 * math.pi  # rad: as far as an encoder counts either way
_FASTEST = 20.0  # rad/s, assumed: four times an STS3215's 45 turns a minute; what is faster is cut off
_MOST_SEED = 2**63


# --- The part that all tasks share: servos, their draw, time, pictures ------------------------------------------------

class ServoTask(gymnasium.Env[Observation, Observation], gymnasium.utils.EzPickle):
    """A robot in MuJoCo whose joints servos move, all of them on one supply, and something for it to do.

    A subclass says which robot, where it begins, what an action is, what is observed, and what it is worth.

    After each step `info` has what `ServoActuated` gives of the servos, in the order of the joints; after a reset under
    `vary` it has "servo_parameters", what was drawn for each (SI), by dotted name. Both have "is_success". A copy, also
    by pickle, is made of the arguments and begins anew.

    Parameters
    ----------
    servo : str, Path, Servo or Model
        At all joints: id in the catalog, path of a servo file, a servo, or its model, which is taken as it is.
    registers : mapping of str to int, or str, optional
        Values by LeRobot's names, or a set of them, in all servos; the robot's own, or the file's, stay unless given.
    supply : Supply or float, optional
        That all servos share, or its voltage [V], which does not sag; that of the servo's file behind 0.1 ohm
        unless given.
    vary : mapping or "stated", optional
        Distributions of numbers, by dotted name, as of `sweep`, or by joint such mappings: at each reset each joint
        draws its own, by the environment's seed; numbers of the supply are drawn once for all. "stated": all that the
        file of the servo says of itself. For a seed all else of an episode is the same as without it.
    render_mode : str, optional
        "rgb_array".
    width, height : int
        Of pictures [pixels].

    Attributes
    ----------
    drive : ServoDrive
    model, data : MjModel, MjData

    Raises
    ------
    InputError
        Or one of its kinds, on bad input.
    MissingExtraError
        If MuJoCo or Gymnasium is not installed.
    """

    metadata: dict[str, Any] = {"render_modes": ["rgb_array"]}  # noqa: RUF012 - as Gymnasium declares it
    rate: ClassVar[int]
    """Actions in a second [Hz]."""
    camera: ClassVar[str]
    lerobot: ClassVar[str] = ""
    """The robot in LeRobot's words, whose registers the servos have; none: those of the file."""

    def __init__(self, *, servo: Any = "feetech-sts3215-12v", registers: Any = None, supply: Any = None,
                 vary: Mapping[str, Any] | str | None = None, render_mode: str | None = None, width: int = 640,
                 height: int = 480) -> None:
        gymnasium.utils.EzPickle.__init__(self, servo=servo, registers=registers, supply=supply, vary=vary,
                                          render_mode=render_mode, width=width, height=height)
        if render_mode not in (None, *self.metadata["render_modes"]):
            raise InputError("render_mode", got=render_mode, allowed="'rgb_array' or None")
        self.render_mode, self._size = render_mode, (width, height)
        mujoco = load_mujoco()
        self.model = mujoco.MjModel.from_xml_string(self._mjcf())
        self.model.opt.timestep = PHYSICS_STEP
        self.model.opt.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
        names = [self.model.actuator(k).name for k in range(self.model.nu)]
        models = [self._servo_at(name, servo, registers) for name in names]
        self.supply = _supply(supply, models[0])
        self.drive = ServoDrive(self.model, {
            name: Mount(model, zero=-mid_travel(model)) for name, model in zip(names, models, strict=True)},
            bus=self.supply, joint_friction="clear", assume_heat=False)
        self.data = mujoco.MjData(self.model)
        self._nominal, self._draws = models, _Draws(vary, names, models, self.supply)
        self._steps = round(1.0 / (self.rate * PHYSICS_STEP))
        joints = [self.model.joint(name) for name in names]
        self._at = np.array([int(joint.qposadr[0]) for joint in joints])
        self._low, self._high = np.array([joint.range for joint in joints]).T
        self._quantum = np.array([model.value_or("firmware.angle_quantum", 0.0) for model in models])
        self._angles, self._speeds, self._action, self._goals = np.zeros((4, len(names)))
        self.action_space = gymnasium.spaces.Box(-1.0, 1.0, (len(names),), np.float32)
        self._begin()
        self._ends = np.concatenate([np.full(len(part), end, np.float32) for part, end in self._parts()])
        self.observation_space = gymnasium.spaces.Box(-self._ends, self._ends, dtype=np.float32)
        self._pictures: Camera | None = None
        self._blind = False

    def _servo_at(self, joint: str, servo: Any, registers: Any) -> Model:
        """Return the model of the servo at a joint, with its registers."""
        if isinstance(servo, Model):
            own: Any = servo.servo
        else:
            own = as_robot_has_it(servo if isinstance(servo, Servo) else load_servo(servo), self.lerobot, joint)
        if registers is not None:
            if not family_label(own):
                raise InputError(f"registers of {own.name}", got=registers, allowed="none: it has none that are known")
            own = set_registers(register_family_of(own), registers, own)
        if isinstance(servo, Model):
            return servo if own is servo.servo else type(servo)(own)
        return default_model(own)

    # --- what a task says ---------------------------------------------------------------------------------------------

    @abstractmethod
    def _mjcf(self) -> str:
        """Return the robot as XML, a motor of its name at each joint that has a servo."""

    @abstractmethod
    def _begin(self) -> None:
        """Put the robot where an episode begins, and the goals of its joints [rad]."""

    @abstractmethod
    def _goals_of(self, action: Array) -> Array:
        """Return where an action sends the joints [rad]."""

    @abstractmethod
    def _parts(self) -> list[tuple[Array, float]]:
        """Return the parts of an observation with the ends of their ranges, which begin at minus that."""

    @abstractmethod
    def _judged(self) -> tuple[float, bool, dict[str, Any]]:
        """Return reward, whether the episode has ended for good, and what `info` has of it."""

    # --- what an environment does -------------------------------------------------------------------------------------

    def reset(self, *, seed: int | None = None,
              options: dict[str, Any] | None = None) -> tuple[Observation, dict[str, Any]]:
        """Begin an episode, with servos drawn anew where they vary.

        Raises
        ------
        UnknownNameError
            If an option is given: there is none.
        """
        super().reset(seed=seed)
        if options:
            raise UnknownNameError("option of reset", next(iter(options)), (), allowed="none")
        own, drawn = int(self.np_random.integers(_MOST_SEED)), {}  # where none vary too: a seed is the same task then
        if self._draws:
            values, supply = self._draws.drawn(own)
            self.drive.set(parameters=values, bus=supply)
            drawn = {"servo_parameters": {**values, **self._draws.of_supply(supply)}}
        mujoco = load_mujoco()
        mujoco.mj_resetData(self.model, self.data)
        self._begin()
        self.data.ctrl[:] = self._goals
        mujoco.mj_forward(self.model, self.data)
        self.drive.reset(self.data)
        self._action[:] = 0.0
        self._angles, self._speeds = self._encoders(), np.zeros_like(self._angles)
        return self._observed(), {**self._judged()[2], **drawn}

    def step(self, action: Any) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Send the joints where an action says, and let a step of the policy pass.

        Raises
        ------
        InputError
            If the action is not one finite number for each joint.
        SimulationError
            If a servo or MuJoCo cannot continue.
        """
        given = np.asarray(action, dtype=np.float64)
        if given.shape != self._action.shape or not np.isfinite(given).all():
            raise InputError("action", got=given, allowed=f"{self._action.size} finite numbers from -1 to 1")
        self._action = np.clip(given, -1.0, 1.0)
        self._goals = self._goals_of(self._action)
        self.data.ctrl[:] = self._goals
        self.drive.step(self.data, self._steps)
        before, self._angles = self._angles, self._encoders()
        self._speeds = (self._angles - before) * self.rate
        reward, ended, info = self._judged()
        return self._observed(), reward, ended, False, {**info, **seen(self.drive, self.data)}

    def _encoders(self) -> Array:
        """Return the angles of the joints in whole counts of their encoders [rad]."""
        exact = self.data.qpos[self._at]
        counts = np.divide(exact, self._quantum, out=np.zeros_like(exact), where=self._quantum > 0.0)
        return np.asarray(np.where(self._quantum > 0.0, np.round(counts) * self._quantum, exact))

    def _observed(self) -> Observation:
        whole = np.concatenate([part for part, _ in self._parts()]).astype(np.float32)
        return np.clip(whole, -self._ends, self._ends)

    def render(self) -> Any:
        """Return a picture, shape (height, width, 3); a black one, with a warning, where none can be drawn."""
        if self.render_mode is None:
            gymnasium.logger.warn('render() without a render_mode: gymnasium.make(..., render_mode="rgb_array")')
            return None
        width, height = self._size
        if self._pictures is None and not self._blind:
            try:
                self._pictures = Camera(self.model, width, height, self.camera)
            except NoDrawingError as error:
                self._blind = True
                gymnasium.logger.warn(f"pictures of this environment are black: {error}")
        if self._pictures is None:
            return np.zeros((height, width, 3), np.uint8)
        return self._pictures.picture(self.data.qpos)

    def close(self) -> None:
        """Give back what the drawing holds."""
        if self._pictures is not None:
            self._pictures.close()
            self._pictures = None


class _Draws:
    """Numbers in which the servos of a robot differ from episode to episode; false where there are none."""

    def __init__(self, vary: Mapping[str, Any] | str | None, joints: list[str], models: list[Model],
                 supply: Supply) -> None:
        if isinstance(vary, str) and vary != "stated":
            raise InputError("vary", got=vary, allowed="'stated', or a mapping of dotted names to distributions")
        given: Any = vary
        of_supply: dict[str, Any] = {}
        if isinstance(vary, str):
            each: list[Any] = [{name: one for name, one in stated(model).items() if name not in OF_THE_BUS}
                               for model in models]
        else:
            if isinstance(vary, Mapping):
                of_supply = {name: one for name, one in vary.items() if name in OF_THE_BUS}
                given = {name: one for name, one in vary.items() if name not in OF_THE_BUS}
            each = [*varied(given, joints)]
        self._models, self._supply, self._names = models, supply, tuple(of_supply)
        self._of_bus = Draw(of_supply, on_supply(models[0], supply)) if of_supply else None
        groups: list[tuple[Model, Mapping[str, Distribution | str], list[int]]] = []
        for k, (model, own) in enumerate(zip(models, each, strict=True)):
            same = next((which for other, known, which in groups if known == own and other.servo == model.servo), None)
            if same is None:
                groups.append((model, own, [k]))
            else:
                same.append(k)
        self._draws = [(Draw(own, model), which) for model, own, which in groups if own]

    def __bool__(self) -> bool:
        return bool(self._draws) or self._of_bus is not None

    def drawn(self, seed: int) -> tuple[dict[str, NDArray[Any]], Supply]:
        """Return numbers of all servos by dotted name, shape (joints,), and their supply."""
        found: dict[str, list[Any]] = {}
        for number, (draw, which) in enumerate(self._draws):
            for name, column in draw.lanes(len(which), (seed + number) % _MOST_SEED).items():
                whole = found.setdefault(name, [model.servo.get(name) for model in self._models])
                for k, value in zip(which, column.tolist(), strict=True):
                    whole[k] = value
        supply = self._supply
        if self._of_bus is not None:
            values = self._of_bus.lanes(1, seed)
            supply = replace(supply, **{name.partition(".")[2]: float(column[0]) for name, column in values.items()})
        return {name: np.array(whole) for name, whole in found.items()}, supply

    def of_supply(self, supply: Supply) -> dict[str, float]:
        """Return what was drawn of the supply, by dotted name."""
        return {name: float(getattr(supply, name.partition(".")[2])) for name in self._names}


def _supply(given: Any, model: Model) -> Supply:
    """Return the supply that all servos share."""
    if isinstance(given, Supply):
        return given
    voltage = model.value_or("supply.open_circuit_voltage", math.nan) if given is None else given
    if not is_finite(voltage) or not voltage > 0.0:
        raise InputError("supply", got=given, allowed="a Supply, or a positive voltage [V]")
    return Supply(open_circuit_voltage=float(voltage), internal_resistance=CABLE if given is None else 0.0)


# --- An SO-101 that reaches -------------------------------------------------------------------------------------------

class SO101Reach(ServoTask):
    """An SO-101 brings the tip of its gripper to a point: `servotwin/SO101Reach-v0`.

    Six STS3215 have the registers that LeRobot writes, the gripper its own. An action moves the goals of the six
    joints, 1 by `STEP`, within the limits of the joints; a leader arm and a policy of LeRobot's give goals too. The arm
    begins folded, the point is drawn where the tip gets to without the table.

    Observed are angles of the joints [rad] as their encoders show them, their mean speeds over the last step [rad/s],
    goals [rad], the last action, the point, the tip, and the way from the tip to the point [m].

    The reward is 1 − tanh(distance / `CLOSE`) in each step. "is_success" says that the tip is within `NEAR` of the
    point now, "distance" how far it is [m]. An episode never ends for good; `gymnasium.make` cuts it off after 5 s.
    """

    rate = 20  # Hz: 25 steps of MuJoCo; as robot learning has it for arms, between 10 and LeRobot's 30
    metadata: dict[str, Any] = {"render_modes": ["rgb_array"], "render_fps": rate}  # noqa: RUF012 - as Gymnasium declares it
    camera, lerobot = "side", "so101_follower"
    STEP = 0.1  # rad, 2 rad/s: half of what an STS3215 can at 12 V
    NEAR, CLOSE = 0.02, 0.2  # m
    FOLDED: ClassVar[Mapping[str, float]] = {
        "shoulder_pan": 0.0, "shoulder_lift": -1.0, "elbow_flex": 1.0, "wrist_flex": 0.4, "wrist_roll": 0.0,
        "gripper": 0.2}  # rad
    SPREAD = 0.05  # rad: of where joints begin about that
    _POSES: ClassVar[Mapping[str, tuple[float, float]]] = {
        "shoulder_pan": (-1.2, 1.2), "shoulder_lift": (-1.2, 0.8), "elbow_flex": (-1.2, 1.4), "wrist_flex": (-1.2, 1.2)}
    _ROOM = (0.04, 0.12)  # m: of the point above the table, and from the axis of the base

    def _mjcf(self) -> str:
        text = mjcf_models.so101(motors=True)
        # Beside the origin: MuJoCo takes a site that is compiled there for the frame of its body ever after.
        point = f'<site name="target" pos="0.2 0 0.2" size="{self.NEAR}" rgba="0.9 0.25 0.2 0.5"/>'
        return text.replace("</worldbody>", f"{point}</worldbody>")

    def _begin(self) -> None:
        mujoco, data, random = load_mujoco(), self.data, self.np_random
        low, high = np.array([self._POSES.get(name, (0.0, 0.0)) for name in self.drive.joints]).T
        for _ in range(1000):
            data.qpos[self._at] = random.uniform(low, high)
            mujoco.mj_kinematics(self.model, data)
            point = data.site("tool").xpos
            if point[2] > self._ROOM[0] and math.hypot(point[0], point[1]) > self._ROOM[1]:
                break
        self.model.site("target").pos[:] = point
        folded = np.array([self.FOLDED[name] for name in self.drive.joints])
        self._goals = folded + random.uniform(-self.SPREAD, self.SPREAD, folded.size)
        data.qpos[self._at] = self._goals

    def _goals_of(self, action: Array) -> Array:
        return np.clip(self._goals + self.STEP * action, self._low, self._high)

    def _parts(self) -> list[tuple[Array, float]]:
        tip, point = self.data.site("tool").xpos, self.model.site("target").pos
        return [(self._angles, _TURN), (self._speeds, _FASTEST), (self._goals, _TURN), (self._action, 1.0),
                (point, 1.0), (tip, 1.0), (point - tip, 2.0)]

    def _judged(self) -> tuple[float, bool, dict[str, Any]]:
        distance = math.dist(self.data.site("tool").xpos, self.model.site("target").pos)
        return 1.0 - math.tanh(distance / self.CLOSE), False, {
            "is_success": distance < self.NEAR, "distance": distance}


# --- A biped that walks -----------------------------------------------------------------------------------------------

class Biped(ServoTask):
    """A biped of 1.3 kg on ten servos walks ahead, along x: `servotwin/Biped-v0`.

    The robot is `mjcf_models.biped`, its servos STS3215 as they leave the factory. An action is where the joints go
    from how it stands, 1 for `SWING`; under 0 it stands. It begins standing, its joints up to `SPREAD` beside.

    Observed are what an IMU in its body gives, the direction of gravity and angular velocities [rad/s] in its own axes;
    angles of the joints from how it stands [rad] as their encoders show them, their mean speeds over the last step
    [rad/s], and the last action.

    The reward of a step is the speed ahead over `PACE`, from −1 to 1, half of how upright it is, from −1 to 1, and less
    0.1 for each A² of the servos' mean square current. The episode ends for good where it falls: where its body leans
    by 60 degrees, or is lower than 0.6 times as it stands. `gymnasium.make` cuts it off after 10 s. "is_success" says
    that it has got `WAY` ahead by now; "distance" [m], "speed" over the last step [m/s] and "height" [m] are those of
    its body.
    """

    rate = 50  # Hz: 10 steps of MuJoCo; as policies for legs usually run, and a bus of ten servos is read and written
    metadata: dict[str, Any] = {"render_modes": ["rgb_array"], "render_fps": rate}  # noqa: RUF012 - as Gymnasium declares it
    camera = "follow"
    SWING = 0.5  # rad
    PACE, WAY = 0.2, 1.0  # m/s, m
    SPREAD = 0.02  # rad
    _GYRO = math.radians(2000.0)  # rad/s: the widest range of gyros such as the MPU-6050
    _UPRIGHT, _TALL = 0.5, 0.6  # cosine of the lean, share of the height

    def _mjcf(self) -> str:
        return mjcf_models.biped()

    def _begin(self) -> None:
        mujoco, data = load_mujoco(), self.data
        self._stance = np.array([mjcf_models.BIPED_STANCE[name] for name in self.drive.joints])
        self._goals = self._stance.copy()
        data.qpos[self._at] = self._stance + self.np_random.uniform(-self.SPREAD, self.SPREAD, self._stance.size)
        mujoco.mj_kinematics(self.model, data)
        feet = [self.model.geom(f"{side}_foot") for side in ("left", "right")]
        data.qpos[2] -= min(float(data.geom_xpos[foot.id][2] - np.abs(data.geom_xmat[foot.id][6:]) @ foot.size)
                            for foot in feet)
        self._before = float(data.qpos[0])

    def _goals_of(self, action: Array) -> Array:
        self._before = float(self.data.qpos[0])
        return np.clip(self._stance + self.SWING * action, self._low, self._high)

    def _parts(self) -> list[tuple[Array, float]]:
        down = -self.data.body("body").xmat[6:]  # of the world's axes the last one, in those of the body
        return [(down, 1.0), (self.data.qvel[3:6], self._GYRO), (self._angles - self._stance, _TURN),
                (self._speeds, _FASTEST), (self._action, 1.0)]

    def _judged(self) -> tuple[float, bool, dict[str, Any]]:
        upright, height = float(self.data.body("body").xmat[8]), float(self.data.qpos[2])
        place = float(self.data.qpos[0])
        speed = (place - self._before) * self.rate
        heat = float(np.mean(np.square(self.drive.look(self.data, "armature_current"))))
        reward = min(max(speed / self.PACE, -1.0), 1.0) + 0.5 * upright - 0.1 * heat
        fallen = upright < self._UPRIGHT or height < self._TALL * mjcf_models.BIPED_HEIGHT
        return reward, fallen, {"is_success": place > self.WAY, "distance": place, "speed": speed, "height": height}
