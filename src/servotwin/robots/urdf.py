"""Robot files of strangers: macros of xacro, meshes of ROS packages, and which joints a URDF says are driven."""

from __future__ import annotations

import shutil
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as Xml

from servotwin.errors import InputError

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
