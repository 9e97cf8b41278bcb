"""Kernels of `WarpDrive`: how each servo meets its joint in each world, and the torque that the joint gets.

Warp reads types from annotations, so that these stay as they are.
"""

from typing import Any

import warp as wp


@wp.kernel
def free_forces(passive: wp.array2d[float], bias: wp.array2d[float], applied: wp.array2d[float],
                constraint: wp.array2d[float], actuator: wp.array2d[float], found: wp.array2d[float]):
    """Add up all forces but those of contacts and actuators now, of which the last step's stand in their place."""
    world, dof = wp.tid()
    found[world, dof] = (passive[world, dof] - bias[world, dof] + applied[world, dof] + constraint[world, dof]
                         + actuator[world, dof])


@wp.kernel
def take_away(speed_at: wp.array[int], applied: wp.array2d[float]):
    """Take the torques of the last step away."""
    world, k = wp.tid()
    applied[world, speed_at[k]] = 0.0


@wp.kernel
def keep_row(solved: wp.array2d[float], speed_at: wp.array[int], k: int, found: wp.array3d[float]):
    """Keep the accelerations of all joints with servos under one newton metre at one of them."""
    world, n = wp.tid()
    found[world, k, n] = solved[world, speed_at[n]]


@wp.func
def angle_of(numbers: wp.array[float], place: float):
    """Return the angle of a servo whose joint is at a place, between its stops."""
    return wp.clamp((place - numbers[1]) / numbers[0], numbers[2], numbers[3])


@wp.func
def within_commands(numbers: wp.array[float], command: float):
    """Return the nearest command that a servo takes."""
    return wp.clamp(command, numbers[11], numbers[12])


@wp.kernel
def meet(qpos: wp.array2d[float], qvel: wp.array2d[float], ctrl: wp.array2d[float], free: wp.array2d[float],
         per_torque: wp.array3d[float], torque: wp.array2d[float], which: wp.array[int], angle_at: wp.array[int],
         speed_at: wp.array[int], command_at: wp.array[int], numbers: wp.array3d[float], count: int,
         joints: int, met: wp.array2d[float], angle: wp.array[float], speed: wp.array[float],
         inertia: wp.array[float], against: wp.array[float], command: wp.array[float]):
    """Find what each servo meets at its shaft: angle, speed, inertia beyond its own, torque; and its command."""
    world, n = wp.tid()
    k = which[n]
    lane = world * count + n
    gain = numbers[world, k, 0]
    a = free[world, speed_at[k]]
    for other in range(joints):
        if other != k:
            a += per_torque[world, k, other] * torque[world, other]
    met[world, k] = a
    J = 1.0 / per_torque[world, k, k]
    angle[lane] = angle_of(numbers[world, k], qpos[world, angle_at[k]])
    speed[lane] = qvel[world, speed_at[k]] / gain
    inertia[lane] = wp.max(J * gain * gain - numbers[world, k, 4], 0.0)
    against[lane] = -J * gain * a
    if command_at[k] >= 0:
        asked = wp.clamp(ctrl[world, command_at[k]], numbers[world, k, 5], numbers[world, k, 6])
        place = numbers[world, k, 8] + numbers[world, k, 7] * asked
        command[lane] = within_commands(numbers[world, k], (place - numbers[world, k, 10]) / numbers[world, k, 9])


@wp.kernel
def find_lack(qvel: wp.array2d[float], free: wp.array2d[float], per_torque: wp.array3d[float], met: wp.array2d[float],
         which: wp.array[int], speed_at: wp.array[int], numbers: wp.array3d[float], count: int, timestep: float,
         speed: wp.array[float], torque: wp.array2d[float], wanted: wp.array2d[float]):
    """Find the torque of each servo, and the acceleration that its joint lacks to gain the speed that it has gained."""
    world, n = wp.tid()
    k = which[n]
    dof = speed_at[k]
    gained = (speed[world * count + n] * numbers[world, k, 0] - qvel[world, dof]) / timestep
    torque[world, k] = (gained - met[world, k]) / per_torque[world, k, k]
    wanted[world, k] = gained - free[world, dof]


@wp.kernel
def push(per_torque: wp.array3d[float], speed_at: wp.array[int], count: int, wanted: wp.array2d[float],
         applied: wp.array2d[float]):
    """Find the torques by which joints get the accelerations that they lack, by Cholesky's factors in their place."""
    world = wp.tid()
    for i in range(count):
        for j in range(i + 1):
            left = per_torque[world, i, j]
            for m in range(j):
                left -= per_torque[world, i, m] * per_torque[world, j, m]
            if i == j:
                per_torque[world, i, i] = wp.sqrt(left)
            else:
                per_torque[world, i, j] = left / per_torque[world, j, j]
    for i in range(count):
        left = wanted[world, i]
        for m in range(i):
            left -= per_torque[world, i, m] * wanted[world, m]
        wanted[world, i] = left / per_torque[world, i, i]
    for k in range(count):
        i = count - 1 - k
        left = wanted[world, i]
        for m in range(i + 1, count):
            left -= per_torque[world, m, i] * wanted[world, m]
        wanted[world, i] = left / per_torque[world, i, i]
        applied[world, speed_at[i]] = wanted[world, i]


@wp.kernel
def place(qpos: wp.array2d[float], mask: wp.array[wp.bool], which: wp.array[int], angle_at: wp.array[int],
          numbers: wp.array3d[float], rest: wp.array[float], count: int, angle: wp.array[float],
          command: wp.array[float], hold: wp.array[float], lanes: wp.array[wp.uint8]):
    """Find where servos of some worlds begin, with the command that lets them stay, and holds unless one was given."""
    world, n = wp.tid()
    k = which[n]
    lane = world * count + n
    lanes[lane] = wp.uint8(0)
    if mask[world]:
        lanes[lane] = wp.uint8(1)
        at = angle_of(numbers[world, k], qpos[world, angle_at[k]])
        angle[lane] = at
        hold[lane] = rest[k]
        if wp.isnan(rest[k]):
            hold[lane] = within_commands(numbers[world, k], at)
        if wp.isnan(command[lane]):
            command[lane] = hold[lane]


@wp.kernel
def command(places: wp.array[float], k: int, n: int, count: int, numbers: wp.array3d[float], command: wp.array[float]):
    """Take the places that a joint of all worlds is commanded to go to."""
    world = wp.tid()
    own = numbers[world, k]
    command[world * count + n] = within_commands(own, (places[world] - own[10]) / own[9])


@wp.kernel
def begin_anew(mask: wp.array[wp.bool], which: wp.array[int], count: int, fresh: wp.array[wp.bool],
               torque: wp.array2d[float], command: wp.array[float]):
    """Note worlds whose servos begin anew, and take their torques and commands away."""
    world, n = wp.tid()
    if mask[world]:
        fresh[world] = True
        torque[world, which[n]] = 0.0
        command[world * count + n] = wp.nan


@wp.kernel
def spread(worlds: wp.array[wp.bool], count: int, lanes: wp.array[wp.uint8]):
    """Mark the lanes of worlds."""
    lane = wp.tid()
    lanes[lane] = wp.uint8(0)
    if worlds[lane // count]:
        lanes[lane] = wp.uint8(1)


@wp.kernel
def take_variant(which: wp.array[int], count: int, variant: wp.array[int], drawn: wp.array2d[float],
                 numbers: wp.array3d[float]):
    """Take the ends of travel and commands, and the inertia, of the servos that lanes are now."""
    world, n = wp.tid()
    own, of = numbers[world, which[n]], variant[world * count + n]
    own[2] = drawn[of, 0]
    own[3] = drawn[of, 1]
    own[11] = drawn[of, 2]
    own[12] = drawn[of, 3]
    own[4] = drawn[of, 4]


@wp.kernel
def put_armature(numbers: wp.array3d[float], speed_at: wp.array[int], armature: wp.array2d[float]):
    """Put the inertias of servos at their joints in their places."""
    world, k = wp.tid()
    gain = numbers[world, k, 0]
    armature[world, speed_at[k]] = numbers[world, k, 4] / (gain * gain)


@wp.kernel
def compare(time: wp.array[float], before: wp.array[float], again: wp.array[wp.bool]):
    """Find the worlds whose time has not passed since the last call."""
    world = wp.tid()
    again[world] = time[world] == before[world]
    before[world] = time[world]


@wp.func
def world_of(k: int, count: int, lanes: int, each: int):
    """Return the world of a number that a lane remembers: of a column, or of so many that stand together."""
    lane = k % lanes
    if each > 0:
        lane = k // each
    return lane // count


@wp.kernel
def take_back(again: wp.array[wp.bool], count: int, lanes: int, each: int, before: wp.array[Any], now: wp.array[Any]):
    """Let numbers of some worlds be what they were before."""
    k = wp.tid()
    if again[world_of(k, count, lanes, each)]:
        now[k] = before[k]


# --- Joints of Newton: arrays of all worlds in one row, inverse inertias by articulation ------------------------------

@wp.kernel
def gather(positions: wp.array[float], velocities: wp.array[float], targets: wp.array[float],
           position_at: wp.array[wp.uint32], velocity_at: wp.array[wp.uint32], target_at: wp.array[wp.uint32],
           count: int, angle: wp.array2d[float], speed: wp.array2d[float], goal: wp.array2d[float]):
    """Gather angles, speeds and targets of joints with servos, world after world."""
    k = wp.tid()
    world, n = k // count, k % count
    angle[world, n] = positions[position_at[k]]
    speed[world, n] = velocities[velocity_at[k]]
    goal[world, n] = targets[target_at[k]]


@wp.kernel
def gather_inverse(inverse: wp.array3d[float], articulation: wp.array[int], local: wp.array[int], count: int,
                   per_torque: wp.array3d[float]):
    """Gather the accelerations of joints under one newton metre at one of them; none across articulations."""
    k, n = wp.tid()
    world = k // count
    other = world * count + n
    found = float(0.0)  # noqa: UP018  a variable, in Warp's words
    if articulation[k] == articulation[other]:
        found = inverse[articulation[k], local[k], local[other]]
    per_torque[world, k % count, n] = found


@wp.kernel
def free_by_forces(inverse: wp.array3d[float], articulation: wp.array[int], local: wp.array[int],
                   start: wp.array[int], dofs: wp.array[int], gravity: wp.array[float], coriolis: wp.array[float],
                   others: wp.array[float], count: int, free: wp.array2d[float]):
    """Find the accelerations of joints by all forces but those of servos."""
    k = wp.tid()
    tree = articulation[k]
    a = float(0.0)  # noqa: UP018
    for j in range(dofs[tree]):
        force = -gravity[start[tree] + j] - coriolis[start[tree] + j]
        if others:
            force += others[start[tree] + j]
        a += inverse[tree, local[k], j] * force
    free[k // count, k % count] = a


@wp.kernel
def free_by_acceleration(qacc: wp.array2d[float], dof: wp.array2d[int], per_torque: wp.array3d[float],
                         torque: wp.array2d[float], count: int, free: wp.array2d[float]):
    """Find them by the accelerations of the last step, less what the servos' torques had given."""
    k = wp.tid()
    world, n = k // count, k % count
    a = qacc[world, dof[world, n]]
    for other in range(count):
        a -= per_torque[world, n, other] * torque[world, other]
    free[world, n] = a


@wp.kernel
def any_of_world(mask: wp.array[wp.bool], count: int, worlds: wp.array[wp.bool]):
    """Find the worlds in which one of so many joints is of a mask."""
    k = wp.tid()
    if mask[k]:
        worlds[k // count] = True


@wp.kernel
def take(worlds: wp.array[wp.bool], others: wp.array2d[float], free: wp.array2d[float]):
    """Take the accelerations of joints in some worlds from elsewhere."""
    world, n = wp.tid()
    if worlds[world]:
        free[world, n] = others[world, n]
