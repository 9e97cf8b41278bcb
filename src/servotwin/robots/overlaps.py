"""Contacts in a robot's model: overlaps of a pose, shapes that are left out of contact, and free fall.

Shapes of real links do not overlap; those of a file often do: hulls of meshes at the base, boxes of a CAD exporter,
feet that begin in the floor. A solver pushes them apart, and servos seem to fight for nothing. MuJoCo leaves the
contact of parent and child out itself, except where the parent is fixed to the world.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from servotwin.errors import InputError
from servotwin.robots.motion import Motion
from servotwin.robots.places import load_mujoco
from servotwin.robots.servos.coupling import couple

Array = NDArray[np.float64]
DEEP = 1e-3  # m: deeper than soft contacts let a small robot sink in
_MOST_KINDS = 31  # of shapes: bits of MuJoCo's contype
_LOOKS = 100  # at the measured joints of an episode
_AIRBORNE, _SAMPLE = 0.3, 0.05  # s: longer than a hop of a robot on hobby servos, and between two looks
_FREELY = 0.03  # of gravity: by how much the acceleration of a falling robot may differ from it


class Overlap(NamedTuple):
    """Two bodies that lie in each other: their numbers, how deep [m], and pairs of shapes by number."""

    first: int
    second: int
    depth: float
    shapes: tuple[tuple[int, int], ...]


class Fall(NamedTuple):
    """A robot that nothing carries: name of its root, way down [m] in a time [s], whether there is anything below."""

    root: str
    way: float
    time: float
    floor: bool

    @property
    def words(self) -> str:
        """One sentence."""
        ground = "nothing carries it" if self.floor else "no floor in the model (its scene is a file of its own?)"
        return f"the robot falls: {self.root} goes {self.way:.3g} m down in {self.time:.3g} s; {ground}"


def body_name(model: Any, body: int) -> str:
    """Return how a body is called."""
    return "what is fixed" if body == 0 else model.body(body).name or f"body {body}"


def joints_between(model: Any, first: int, second: int) -> tuple[str, ...]:
    """Return the joints on the way from one body to another."""
    above = [_line(model, body) for body in (first, second)]
    bodies = [body for body in (*above[0], *above[1]) if (body in above[0]) != (body in above[1])]
    return tuple(model.joint(k).name for body in bodies for k in range(
        int(model.body_jntadr[body]), int(model.body_jntadr[body]) + int(model.body_jntnum[body])))


def passive_joints(model: Any) -> set[str]:
    """Return the joints that a spring moves, and those of loops that a connect or weld closes."""
    mujoco = load_mujoco()
    found = {model.joint(k).name for k in range(model.njnt) if np.any(model.jnt_stiffness[k] != 0.0)}
    for n in np.flatnonzero(model.eq_active0).tolist():
        if int(model.eq_type[n]) in (int(mujoco.mjtEq.mjEQ_CONNECT), int(mujoco.mjtEq.mjEQ_WELD)):
            ends = [int(end) for end in (model.eq_obj1id[n], model.eq_obj2id[n])]
            if int(model.eq_objtype[n]) == int(mujoco.mjtObj.mjOBJ_SITE):
                ends = [int(model.site_bodyid[end]) for end in ends]
            found.update(joints_between(model, *ends))
    return found


def _line(model: Any, body: int) -> list[int]:
    """Return a body and all above it but the world."""
    found = []
    while body != 0:
        found.append(body)
        body = int(model.body_parentid[body])
    return found


def robot_bodies(model: Any, joints: Iterable[str]) -> set[int]:
    """Return the bodies of the robots that joints are of: all below their roots, and what their bases are made of."""
    found = set()
    for joint in joints:
        body = int(model.jnt_bodyid[model.joint(joint).id])
        found.add(_top(model, body))
    return {body for body in range(1, model.nbody) if _top(model, body) in found}


def _top(model: Any, body: int) -> int:
    """Return the ancestor of a body, or itself, that stands in the world."""
    return _line(model, body)[-1]


def overlaps(model: Any, qpos: Array, bodies: Iterable[int] | None = None) -> list[Overlap]:
    """Return which bodies lie in each other by more than `DEEP` in a pose and are not left out of contact.

    Parameters
    ----------
    model : MjModel
    qpos : ndarray, shape (nq,)
    bodies : iterable of int, optional
        Of which at least one takes part; all unless given.

    Returns
    -------
    list of Overlap
        The deepest first.
    """
    mujoco = load_mujoco()
    data = mujoco.MjData(model)
    data.qpos[:] = qpos
    mujoco.mj_fwdPosition(model, data)
    asked = None if bodies is None else set(bodies)
    depths: dict[tuple[int, int], float] = {}
    shapes: dict[tuple[int, int], set[tuple[int, int]]] = {}
    for contact in data.contact:
        pair = tuple(sorted(int(geom) for geom in contact.geom))
        if pair[0] < 0 or contact.dist > -DEEP:
            continue
        ends = sorted(int(model.geom_bodyid[geom]) for geom in pair)
        if asked is None or asked & set(ends):
            key = ends[0], ends[1]
            depths[key] = max(depths.get(key, 0.0), -float(contact.dist))
            shapes.setdefault(key, set()).add((pair[0], pair[1]))
    return sorted((Overlap(*key, depth, tuple(sorted(shapes[key]))) for key, depth in depths.items()),
                  key=lambda one: -one.depth)


def links_of(model: Any, found: Iterable[Overlap], *, ground: bool = False) -> list[tuple[int, int]]:
    """Return the pairs of shapes that overlaps stand for, but for those with planes and height fields, the ground.

    Of two links all shapes; of what is the world's own those that overlap alone, as the floor may be one of them.
    """
    pairs = [pair for one in found for pair in (one.shapes if one.first == 0 else itertools.product(
        _shapes(model, one.first), _shapes(model, one.second)))]
    return [pair for pair in pairs if ground or not any(_is_ground(model, geom) for geom in pair)]


def leave_out_measured(model: Any, motions: Iterable[Motion]) -> tuple[str, ...]:
    """Leave out contacts in which measured joints lie: real links were there, so shapes or their places are wrong.

    Where a robot stands on its feet nobody measured its root, and the ground stays.

    Parameters
    ----------
    model : MjModel
        Changed in place.
    motions : iterable of Motion
        With measured joints.

    Returns
    -------
    tuple of str
        A sentence on each pair of bodies.
    """
    deepest: dict[tuple[int, int], Overlap] = {}
    joints: set[str] = set()
    for motion in motions:
        places = {name: int(model.jnt_qposadr[k]) for k in range(model.njnt)
                  if (name := model.joint(k).name) in motion.measured}  # others are refused where the robot is run
        joints |= places.keys()
        for row in np.unique(np.linspace(0, len(motion.time) - 1, _LOOKS).astype(int)).tolist():
            pose = model.qpos0.copy()
            for joint, place in places.items():
                pose[place] = motion.measured[joint][row]
            if not np.isfinite(pose).all():
                continue
            couple(model, pose)
            for one in overlaps(model, pose, robot_bodies(model, places)):
                known = deepest.get((one.first, one.second), one)
                deepest[one.first, one.second] = Overlap(
                    one.first, one.second, max(one.depth, known.depth), tuple(sorted({*one.shapes, *known.shapes})))
    found = [one for one in deepest.values() if one.first != 0 or not _roots(model, joints)]
    leave_out(model, links_of(model, found, ground=True))
    return tuple(f"where joints were measured {overlap_words(model, one)}: left out of contact" for one in found)


def _is_ground(model: Any, geom: int) -> bool:
    """Tell whether a shape is a plane or a height field."""
    kinds = load_mujoco().mjtGeom
    return int(model.geom_type[geom]) in (int(kinds.mjGEOM_PLANE), int(kinds.mjGEOM_HFIELD))


def overlap_words(model: Any, one: Overlap) -> str:
    """Return how deep two bodies lie in each other.

    Examples
    --------
    >>> import mujoco
    >>> ball = mujoco.MjModel.from_xml_string('''<mujoco><worldbody><geom name="floor" type="plane" size="1 1 .1"/>
    ...   <body name="foot" pos="0 0 .03"><freejoint/><geom size=".047"/></body></worldbody></mujoco>''')
    >>> [overlap_words(ball, one) for one in overlaps(ball, ball.qpos0)]
    ['foot lies 17 mm in floor']
    """
    names = [body_name(model, body) for body in (one.second, one.first)]
    if one.first == 0:
        geom = next(geom for geom in one.shapes[0] if model.geom_bodyid[geom] == 0)
        names[1] = model.geom(geom).name or ("the ground" if _is_ground(model, geom) else names[1])
    return f"{names[0]} lies {1e3 * one.depth:.3g} mm in {names[1]}"


def leave_out(model: Any, pairs: Iterable[tuple[int, int]]) -> None:
    """Let pairs of shapes touch no more, and all others as before; pairs that the file names itself still do.

    MuJoCo's filter has 32 kinds of shapes: each set of shapes that touch the same others becomes one.

    Raises
    ------
    InputError
        If there would be more.
    """
    count = model.ngeom
    kind = np.concatenate([model.geom_contype, model.flex_contype])
    likes = np.concatenate([model.geom_conaffinity, model.flex_conaffinity])
    meet = (kind[:, None] & likes) | (likes[:, None] & kind) != 0
    for a, b in pairs:
        meet[a, b] = meet[b, a] = False
    rows, kinds = np.unique(meet, axis=0, return_inverse=True)
    some = rows.any(axis=1)  # what touches nothing needs no bit
    if np.count_nonzero(some) > _MOST_KINDS:
        raise InputError("shapes that overlap", got=f"{np.count_nonzero(some)} kinds",
                         allowed=f"up to {_MOST_KINDS} that MuJoCo's filter can tell apart: <exclude> in the robot's "
                         "file does without")
    own = np.where(some, 1 << (np.cumsum(some) - 1).clip(0), 0)[kinds.ravel()]
    asks = np.bitwise_or.reduce(meet * own, axis=1, initial=0)  # the kinds that each shape touches
    model.geom_contype[:], model.flex_contype[:] = own[:count], own[count:]
    model.geom_conaffinity[:], model.flex_conaffinity[:] = asks[:count], asks[count:]
    for body in range(model.nbody):
        at = _shapes(model, body)
        model.body_contype[body] = np.bitwise_or.reduce(model.geom_contype[at], initial=0)
        model.body_conaffinity[body] = np.bitwise_or.reduce(model.geom_conaffinity[at], initial=0)


def _shapes(model: Any, body: int) -> list[int]:
    first = int(model.body_geomadr[body])
    return list(range(first, first + int(model.body_geomnum[body])))


def part_neighbours(model: Any, *, fixed: Sequence[int] = (), always: bool = False,
                    parents: Mapping[str, str] | None = None) -> tuple[str, ...]:
    """Let the links that a joint joins touch each other no more, also where the parent is fixed to the world.

    MuJoCo does so itself between links that move. Planes, height fields and all other shapes of the world's own are a
    scene, and touch.

    Parameters
    ----------
    model : MjModel
        Changed in place.
    fixed : sequence of int
        Shapes of the world that are the robot's own: those of a root that was merged into it.
    always : bool
        Whether all of them are left out, as of a URDF, which has no contact; else, as an MJCF has its own choice,
        those alone whose shapes overlap in the first pose.
    parents : mapping of str to str, optional
        Links by their children, where a merged one has lost its name.

    Returns
    -------
    tuple of str
        A sentence on each pair that overlapped.
    """
    deep = overlaps(model, model.qpos0)
    pairs: list[tuple[int, int]] = []
    said = []
    for joint, (above, below) in _joined(model, fixed).items():
        between = {(min(a, b), max(a, b)) for a in above for b in below}
        found = [(one, pair) for one in deep for pair in one.shapes if pair in between]
        if found:
            one = found[0][0]
            child = model.body(int(model.jnt_bodyid[joint])).name
            parent = (parents or {}).get(child) or body_name(model, one.first)
            said.append(f"{parent} and {child} overlap by {1e3 * one.depth:.3g} mm in the first pose; joint "
                        f"{model.joint(joint).name} joins them: left out of contact")
        if found or always:
            pairs += between
    if pairs:
        leave_out(model, pairs)
    return tuple(said)


def _joined(model: Any, fixed: Sequence[int]) -> dict[int, tuple[list[int], list[int]]]:
    """Return the shapes on either side of the first joint of each body that MuJoCo lets touch each other."""
    mujoco = load_mujoco()
    free = int(mujoco.mjtJoint.mjJNT_FREE)
    all_touch = bool(model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_FILTERPARENT)
    groups = model.body_weldid.tolist()
    found = {}
    for body in range(1, model.nbody):
        joint, parent = int(model.body_jntadr[body]), int(model.body_parentid[body])
        if joint < 0 or model.jnt_type[joint] == free or not (all_touch or groups[parent] == 0):
            continue
        if groups[parent] == 0:
            base = _top(model, body)  # the body itself where it hangs in the world
            above = [k for k in range(1, model.nbody) if groups[k] == 0 and _top(model, k) == base]
            shapes = list(fixed)
        else:
            above, shapes = [k for k in range(1, model.nbody) if groups[k] == groups[parent]], []
        below = [k for k in range(1, model.nbody) if groups[k] == groups[body]]
        found[joint] = (shapes + [geom for k in above for geom in _shapes(model, k)],
                        [geom for k in below for geom in _shapes(model, k)])
    return found


def fall_of(model: Any, time: Array, poses: Array, joints: Iterable[str]) -> Fall | None:
    """Return how a robot falls on whose joints there are servos; None if it is fixed or something carries it.

    It falls where its centre of mass has the acceleration of gravity for 0.3 s, after time 0 if there is that much.

    Parameters
    ----------
    model : MjModel
    time : ndarray, shape (n,)
        [s]
    poses : ndarray, shape (n, nq)
    joints : iterable of str
    """
    mujoco = load_mujoco()
    gravity = float(np.linalg.norm(model.opt.gravity))
    roots = _roots(model, joints)
    half = round(0.5 * _AIRBORNE / _SAMPLE)
    looks = np.arange(time[0], time[-1], _SAMPLE)
    if not roots or gravity == 0.0 or len(looks) <= 2 * half:
        return None
    data, rows = mujoco.MjData(model), np.searchsorted(time, looks).clip(0, len(time) - 1)
    way = np.empty((len(rows), len(roots)))
    for k, row in enumerate(rows.tolist()):
        data.qpos[:] = poses[row]
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        way[k] = [data.subtree_com[body] @ model.opt.gravity / gravity for body in roots]
    step = half * _SAMPLE
    pulled = (way[2 * half:] - 2.0 * way[half:-half] + way[:-2 * half]) / step**2
    if time[-1] > 2.0 * _AIRBORNE:  # long enough for what falls at first to come to stand
        pulled = pulled[looks[half:-half] >= 0.5 * _AIRBORNE]
    falls = (np.abs(pulled - gravity) < _FREELY * gravity).any(axis=0)
    if not falls.any():
        return None
    k = int(np.argmax(falls))
    standing = [geom for geom in range(model.ngeom) if model.body_weldid[model.geom_bodyid[geom]] == 0
                and (model.geom_contype[geom] or model.geom_conaffinity[geom])]
    return Fall(body_name(model, roots[k]), float(np.ptp(way[:, k])), float(looks[-1] - looks[0]), bool(standing))


def _roots(model: Any, joints: Iterable[str]) -> list[int]:
    """Return the bodies with a free joint that joints hang on."""
    free = load_mujoco().mjtJoint.mjJNT_FREE
    tops = {_top(model, int(model.jnt_bodyid[model.joint(joint).id])) for joint in joints}
    return sorted(body for body in tops
                  if model.body_jntnum[body] and model.jnt_type[model.body_jntadr[body]] == free)
