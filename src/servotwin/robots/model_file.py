"""Models of robots: MJCF files, and those that come with the package."""

from __future__ import annotations

import copy
import math
import shutil
import subprocess
import sys
from collections.abc import Callable, Container, Iterable, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple
from xml.etree import ElementTree as Xml

from servotwin.errors import InputError, UnknownNameError
from servotwin.robots.mjcf_models import mobile_robot, so101
from servotwin.robots.overlaps import part_neighbours, passive_joints
from servotwin.robots.places import load_mujoco
from servotwin.robots.servos.coupling import actuators_at_joints, couplings_of, other_actuators
from servotwin.text import checked_name, fault_of

# --- Robot files of strangers: macros of xacro, meshes of ROS packages, and which joints a URDF says are --------------

_READABLE = (".stl", ".obj", ".msh")  # meshes that MuJoCo reads
_PATIENCE = 60.0  # s, for macros
_MOST_NAMED = 3


def urdf_of(path: Path) -> Xml.Element | None:
    """Return the root of a URDF file, whatever its ending, with its macros expanded; None of any other file.

    Raises
    ------
    InputError
        If it is SDF, or has macros that nothing here expands.
    """
    try:
        root = Xml.fromstring(path.read_bytes())
    except (Xml.ParseError, OSError, ValueError):
        return None  # MuJoCo says what is wrong
    if root.tag == "sdf":
        raise InputError(f"{path} is SDF", allowed="an MJCF file (.xml), a URDF, or a xacro file that becomes one")
    if root.tag != "robot":
        return None
    return _expanded(path) if _has_macros(root) else root


def _has_macros(root: Xml.Element) -> bool:
    """Tell whether a URDF has elements or expressions of xacro."""
    return any("/xacro}" in each.tag or any("${" in text or "$(" in text for text in each.attrib.values())
               for each in root.iter() if isinstance(each.tag, str))


def _expanded(path: Path) -> Xml.Element:
    """Return the root of a file that xacro has expanded, in a process of its own: it runs expressions of strangers."""
    program = shutil.which("xacro") or shutil.which("xacro", path=str(Path(sys.executable).parent))
    target = f"{path.name.removesuffix('.xacro').removesuffix('.urdf')}.urdf"
    if program is None:
        raise InputError(f"{path} holds macros", allowed=f"what this makes of it: xacro {path} > {target} (pip install "
                         "xacro; where it is installed, the file can be given itself)")
    try:
        done = subprocess.run([program, str(path)], capture_output=True, timeout=_PATIENCE, check=False)
        if done.returncode == 0:
            return Xml.fromstring(done.stdout)
        said = [line for line in done.stderr.decode(errors="replace").splitlines() if line.strip()]
        why = said[0] if said else f"exit code {done.returncode}"
    except (OSError, subprocess.TimeoutExpired, Xml.ParseError) as error:
        why = str(error)
    raise InputError(f"{path}: xacro cannot expand it ({' '.join(why.split())})")


def parents_in(root: Xml.Element) -> dict[str, str]:
    """Return the links of a URDF by those that its joints hang on them."""
    ends = ((joint.find("child"), joint.find("parent")) for joint in root.iter("joint"))
    return {child.get("link", ""): parent.get("link", "") for child, parent in ends
            if child is not None and parent is not None}


def driven_in(root: Xml.Element) -> tuple[str, ...] | None:
    """Return the joints of a URDF's transmissions, and those that ros2_control commands; None where it has neither."""
    if root.find(".//transmission") is None and root.find(".//ros2_control") is None:
        return None
    named = [joint for each in root.iter("transmission") for joint in each.iter("joint")]
    named += [joint for each in root.iter("ros2_control") for joint in each.iter("joint")
              if joint.find("command_interface") is not None]
    return tuple(dict.fromkeys(joint.get("name", "") for joint in named))


def find_meshes(spec: Any, path: Path, packages: Mapping[str, str | Path]) -> tuple[str, ...]:
    """Let the meshes of an MjSpec be files that are there; shapes whose mesh is not there go, and sentences say so.

    ``package://NAME/`` is a folder NAME, or one whose package.xml says so, above the robot's file or where `packages`
    has it.

    Raises
    ------
    InputError
        If a link has no mass but that of a mesh that is not there or that MuJoCo does not read.
    """
    shown, touching = [], dict[str, list[str]]()
    for mesh in list(spec.meshes):
        if not mesh.file:
            continue  # its points stand in the file of the robot
        place = _place(mesh.file, path, spec.meshdir, packages)
        readable = Path(mesh.file).suffix.lower() in _READABLE
        if place is not None and readable:
            if "://" in mesh.file:
                mesh.file = str(place)
            continue
        why = f"not found ({_short(mesh.file)})" if place is None else (
            f"in {_short(mesh.file)}, which MuJoCo does not read (STL and OBJ it does)")
        for body in spec.bodies:
            for geom in [geom for geom in body.geoms if geom.meshname == mesh.name]:
                if not _has_mass(body):
                    raise InputError(f"{path}: mesh of {body.name}", got=mesh.file, allowed=(
                        "a file that is there (--package NAME=FOLDER says where), or <inertial> in that link"
                        if place is None else f"STL or OBJ, which MuJoCo reads, not {Path(mesh.file).suffix}; or "
                        "<inertial> in that link"))
                if geom.contype or geom.conaffinity:
                    touching.setdefault(why, []).append(body.name)
                else:
                    shown.append(Path(mesh.file).name)
                spec.delete(geom)
        spec.delete(mesh)
    said = [f"collision shapes of {', '.join(dict.fromkeys(bodies))} are {why}: left out, they touch nothing"
            for why, bodies in touching.items()]
    if shown:
        names = list(dict.fromkeys(shown))
        more = f" and {len(names) - _MOST_NAMED} more" if len(names) > _MOST_NAMED else ""
        said.append(f"meshes that only show are left out: {', '.join(names[:_MOST_NAMED])}{more}")
    return tuple(said)


def _has_mass(body: Any) -> bool:
    """Tell whether a body has its mass without its shapes, or needs none as it is fixed to the world."""
    if body.explicitinertial:
        return True
    above = body
    while above is not None and above.name != "world":
        if len(above.joints):
            return False
        above = above.parent
    return True


def _short(name: str) -> str:
    """Return the package of a mesh, or its file."""
    scheme, found, rest = name.partition("://")
    return f"{scheme}://{rest.partition('/')[0]}" if found else name


def _place(name: str, path: Path, folder: str, packages: Mapping[str, str | Path]) -> Path | None:
    """Return the file of a mesh, None where there is none."""
    scheme, found, rest = name.partition("://")
    if found and scheme in ("package", "model"):
        package, _, name = rest.partition("/")
        above = list(path.resolve().parents)
        roots = [Path(packages[package])] if package in packages else [
            *(each / package for each in above), *(each for each in above if _is_package(each, package))]
    else:
        roots, name = [path.parent / folder, path.parent], rest if found else name
    return next((root / name for root in roots if (root / name).is_file()), None)


def _is_package(folder: Path, name: str) -> bool:
    """Tell whether a folder is a ROS package of a name, whatever it is called itself."""
    try:
        root = Xml.fromstring((folder / "package.xml").read_bytes())
    except (OSError, Xml.ParseError, ValueError):
        return False
    return (root.findtext("name") or "").strip() == name


# --- Models of robots: MJCF files, and those that come with the package -----------------------------------------------

BUILT_IN: Mapping[str, Callable[[], str]] = MappingProxyType({"so101": so101, "mobile": mobile_robot})
"""MJCF of robots that come with the package, by name."""
_WORDS = {"jnt": "joint", "cam": "camera", "tex": "texture", "mat": "material"}
_SKY = {"rgb1": (0.66, 0.75, 0.86), "rgb2": (0.93, 0.95, 0.97), "width": 64, "height": 384}
_LIGHT = ((0.4, 0.4, 0.4), (0.6, 0.6, 0.6))  # ambient and diffuse, of a robot that has none


class Plant(NamedTuple):
    """A robot's MjModel, and what its file says that a model does not hold; functions that take a model take it too.

    Parameters
    ----------
    model : MjModel
    said : tuple of str
        Sentences on what was done about the file.
    driven : tuple of str, optional
        Joints that the file says are driven, where its actuators do not.
    """

    model: Any
    said: tuple[str, ...] = ()
    driven: tuple[str, ...] | None = None


def robot_model(source: Any, packages: Mapping[str, str | Path] = MappingProxyType({})) -> Any:
    """Return an MjModel of its own, which may be changed.

    Links that a joint joins do not touch each other in it: of a URDF none do, and of an MJCF, whose own choice stands,
    those that do not overlap by over 1 mm in the first pose.

    Parameters
    ----------
    source : MjModel, MjSpec, Plant, str or Path
        A path is of an MJCF or URDF file, or of one with xacro's macros where `xacro` is installed; a string may be the
        name of a robot that comes with the package. A model of a file gets a sky and light where it has none:
        pictures would be black.
    packages : mapping of str to path
        Folders of ROS packages that ``package://`` names, where they are not among the file's parents.

    Raises
    ------
    InputError
        If there is no such file, or MuJoCo cannot read it: one line.
    MissingExtraError
        If MuJoCo is not installed.

    Examples
    --------
    >>> robot_model("so101").njnt
    6
    """
    return plant_of(source, packages).model


def plant_of(source: Any, packages: Mapping[str, str | Path] = MappingProxyType({})) -> Plant:
    """Return an MjModel of its own, as `robot_model` does, and what its file says beside it."""
    mujoco = load_mujoco()
    if isinstance(source, Plant):
        return source._replace(model=copy.copy(source.model))
    if isinstance(source, mujoco.MjModel):
        own = copy.copy(source)
        return Plant(own, part_neighbours(own))
    if isinstance(source, mujoco.MjSpec):
        return _compiled(source.copy(), {})
    if not isinstance(source, str | Path) or not str(source):
        raise InputError("model of a robot", got=source, allowed="an MjModel, an MjSpec or the path of an MJCF file")
    if str(source) in BUILT_IN:
        model = mujoco.MjModel.from_xml_string(BUILT_IN[str(source)]())
        return Plant(model, driven=tuple(joint_names(model)))
    return _read(mujoco, Path(source), packages)


def _read(mujoco: Any, path: Path, packages: Mapping[str, str | Path]) -> Plant:
    try:
        is_file = path.is_file()
    except (OSError, ValueError):  # a name that no file can have
        is_file = False
    if not is_file:
        if path.suffix or len(path.parts) > 1:
            raise InputError(f"{path} is no file", allowed=f"the path of an MJCF file (.xml), or {', '.join(BUILT_IN)}")
        raise UnknownNameError("robot", str(path), BUILT_IN,
                               allowed=f"the path of an MJCF file (.xml), or {', '.join(BUILT_IN)}")
    urdf = urdf_of(path)
    try:
        if urdf is None:
            spec = mujoco.MjSpec.from_file(str(path))
        else:
            spec = mujoco.MjSpec.from_string(Xml.tostring(urdf, encoding="unicode"))
            spec.modelfiledir = str(path.parent)
        said = find_meshes(spec, path, packages)
        if not any(texture.type == mujoco.mjtTexture.mjTEXTURE_SKYBOX for texture in spec.textures):
            spec.add_texture(name="servotwin sky", type=mujoco.mjtTexture.mjTEXTURE_SKYBOX,
                             builtin=mujoco.mjtBuiltin.mjBUILTIN_GRADIENT, **_SKY)
        if not spec.lights:
            light = spec.visual.headlight
            light.ambient, light.diffuse = _LIGHT
        plant = _compiled(spec, {} if urdf is None else parents_in(urdf))
    except InputError:
        raise
    except Exception as error:  # MuJoCo raises ValueError, its own FatalError and what its plugins raise
        raise InputError(f"{path} is no model that MuJoCo reads ({' '.join(str(error).split())})") from None
    model = plant.model
    names = bytes(model.names).decode("utf-8", "surrogateescape")  # of the robot, its joints and all else
    for name in names.split("\0"):
        if fault_of(name, math.inf):
            checked_name(f"{path}: name{_of_what(model, names, name)}", name, math.inf)
    return plant._replace(said=(*said, *plant.said), driven=None if urdf is None else driven_in(urdf))


def _compiled(spec: Any, parents: Mapping[str, str]) -> Plant:
    """Return the model of a spec whose neighbours do not touch; `parents` are links of a URDF by their children."""
    scene = len(spec.worldbody.geoms)
    model = spec.compile()
    merged = range(scene, int(model.body_geomnum[0]))  # into the world, whose own shapes come first
    return Plant(model, part_neighbours(model, fixed=merged, always=bool(parents), parents=parents))


class Driven(NamedTuple):
    """Hinges of a robot that are driven, and sentences on those that are not."""

    joints: tuple[str, ...]
    said: tuple[str, ...]


def driven_joints(plant: Plant, moved: Iterable[str] | None = None, named: Container[str] = ()) -> Driven:
    """Return the hinges that a robot drives, none that follow others: where servos are put if nobody names joints.

    They are those of the file's actuators; of a URDF those of its transmissions or of ros2_control; where a file says
    nothing, those that a motion moves; without a motion, those that neither a spring moves nor a loop closes.

    Parameters
    ----------
    plant : Plant
    moved : iterable of str, optional
        Joints of the motion.
    named : container of str
        Joints that get a servo anyway, of which nothing is said.

    Examples
    --------
    >>> foot = robot_model(load_mujoco().MjSpec.from_string('''<mujoco><worldbody><body><joint name="knee"/>
    ...   <geom size=".1"/><body><joint name="toe" stiffness="1"/><geom size=".1"/></body></body></worldbody>
    ...   <actuator><position joint="knee"/></actuator></mujoco>'''))
    >>> driven_joints(Plant(foot))
    Driven(joints=('knee',), said=('no servo at toe: no actuator of the file drives it',))
    """
    model = plant.model
    hinges = [joint for joint, kind in joint_names(model).items() if kind == "angle"]
    at_joints = {model.joint(int(model.actuator_trnid[k, 0])).name for k in actuators_at_joints(model)}
    if plant.driven is not None:
        driven, why = set(plant.driven), "the file does not name it as driven"
    elif model.nu:
        driven, why = at_joints, "no actuator of the file drives it"
    elif moved is not None:
        driven, why = set(moved), "the motion says nothing of it"
    else:
        driven, why = set(hinges) - passive_joints(model), "a spring moves it, or it is part of a closed loop"
    followers = couplings_of(model)
    left = [joint for joint in hinges if joint not in driven and joint not in followers
            and joint not in named]
    said = [f"no servo at {', '.join(left)}: {why}"] if left else []
    said += [f"actuator {name} is at a {kind}, and gets no servo" for name, kind in other_actuators(model)]
    return Driven(tuple(joint for joint in hinges if joint in driven and joint not in followers), tuple(said))


def _of_what(model: Any, names: str, name: str) -> str:
    """Return what of a model has a name, in MuJoCo's words."""
    at = len(names[:names.index(name)].encode("utf-8", "surrogateescape"))
    kinds = (kind for kind in dir(model) if kind.startswith("name_") and kind.endswith("adr"))
    found = next((kind for kind in kinds if at in getattr(model, kind)), "")[len("name_"):-len("adr")]
    return f" of a {_WORDS.get(found, found)}" if found else " of the model"


def joint_names(model: Any) -> dict[str, str]:
    """Return "angle" of each hinge and "length" of each slide that has a name, in the order of the model.

    Examples
    --------
    >>> list(joint_names(robot_model("so101")))[:2]
    ['shoulder_pan', 'shoulder_lift']
    """
    mujoco = load_mujoco()
    kinds = {mujoco.mjtJoint.mjJNT_HINGE: "angle", mujoco.mjtJoint.mjJNT_SLIDE: "length"}
    found = {model.joint(k).name: mujoco.mjtJoint(model.jnt_type[k]) for k in range(model.njnt)}
    return {name: kinds[kind] for name, kind in found.items() if name and kind in kinds}


def joint_ranges(model: Any) -> dict[str, tuple[float, float]]:
    """Return the limits of all joints that have a name and limits [rad or m]."""
    return {name: (float(model.joint(name).range[0]), float(model.joint(name).range[1]))
            for name in joint_names(model) if model.jnt_limited[model.joint(name).id]}
