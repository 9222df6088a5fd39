"""Kernels of a step: drive rows, efforts, the check of the state, and copies of rows."""

from __future__ import annotations

import warp as wp

from .model import UNLIMITED

# Weight of the row of a drive without gains; its limit of 0 makes it carry no force.
IDLE_STIFFNESS = wp.constant(1.0e-6)
LIMIT = wp.constant(wp.float32(UNLIMITED))
# MuJoCo treats a larger number in the state as divergence.
MAX_STATE = wp.constant(1.0e10)
# Bits of the reasons of a divergence.
BAD_QPOS = wp.constant(1)
BAD_QVEL = wp.constant(2)
BAD_QACC = wp.constant(4)


@wp.kernel(enable_backward=False)
def apply_inputs(
    timestep: wp.array[float],
    dof_drive: wp.array[int],
    dof_damped: wp.array[int],
    drive_qpos: wp.array[int],
    drive_ctrl: wp.array[int],
    stiffness: wp.array2d[float],
    damping: wp.array2d[float],
    max_effort: wp.array2d[float],
    target_position: wp.array2d[float],
    target_velocity: wp.array2d[float],
    feedforward: wp.array2d[float],
    viscous_damping: wp.array2d[float],
    user_force: wp.array2d[float],
    qpos: wp.array2d[float],
    qvel: wp.array2d[float],
    friction_row: wp.array2d[int],
    frozen: wp.array[int],
    # outputs
    ctrl: wp.array2d[float],
    applied_force: wp.array2d[float],
    row_weight: wp.array2d[float],
    row_reference: wp.array2d[float],
    row_limit: wp.array2d[float],
    rows: wp.array[int],
    equality_rows: wp.array[int],
    friction_rows: wp.array[int],
    limit_rows: wp.array[int],
    step_index: wp.array[int],
) -> None:
    """Writes the forces on all degrees of freedom, and the friction rows of drives: the law of `sim/src/drive/implicit.rs`."""
    w, dof = wp.tid()
    if w == 0 and dof == 0:
        step_index[0] = step_index[0] + 1
    if dof == 0 and frozen[w] != 0:
        # The solver iterates until all environments converge; without rows, a frozen one converges at once.
        rows[w] = 0
        equality_rows[w] = 0
        friction_rows[w] = 0
        limit_rows[w] = 0
    force = user_force[w, dof]
    damped = dof_damped[dof]
    if damped >= 0:
        # The armature of the model contains the implicit half.
        force -= viscous_damping[w, damped] * qvel[w, dof]
    drive = dof_drive[dof]
    if drive >= 0:
        kp = stiffness[w, drive]
        kd = damping[w, drive]
        target = target_position[w, drive]
        limit = wp.min(max_effort[w, drive], LIMIT)
        ctrl[w, drive_ctrl[drive]] = target
        weight = IDLE_STIFFNESS
        reference = float(0.0)
        if kp > 0.0 or kd > 0.0:
            h = timestep[w % timestep.shape[0]]
            weight = h * (kd + h * kp)
            effort = kp * (target - qpos[w, drive_qpos[drive]]) + kd * target_velocity[w, drive] + feedforward[w, drive]
            reference = effort / weight - qvel[w, dof] / h
        else:
            force += wp.clamp(feedforward[w, drive], -limit, limit)
            limit = 0.0
        row = friction_row[w, dof]
        # Without enough rows, the step is repeated with more.
        if row >= 0:
            row_weight[w, row] = weight
            row_reference[w, row] = reference
            row_limit[w, row] = limit
    applied_force[w, dof] = force


@wp.kernel(enable_backward=False)
def read_efforts(
    drive_dof: wp.array[int],
    stiffness: wp.array2d[float],
    damping: wp.array2d[float],
    max_effort: wp.array2d[float],
    feedforward: wp.array2d[float],
    friction_row: wp.array2d[int],
    row_force: wp.array2d[float],
    bad: wp.array[int],
    # outputs
    effort: wp.array2d[float],
) -> None:
    """Stores the efforts of drives; those of a diverged environment stay as they are."""
    w, drive = wp.tid()
    if bad[w] != 0:
        return
    if stiffness[w, drive] > 0.0 or damping[w, drive] > 0.0:
        row = friction_row[w, drive_dof[drive]]
        if row >= 0:
            effort[w, drive] = row_force[w, row]
    else:
        limit = wp.min(max_effort[w, drive], LIMIT)
        effort[w, drive] = wp.clamp(feedforward[w, drive], -limit, limit)


@wp.kernel(enable_backward=False)
def check_state(
    nq: int,
    nv: int,
    qpos: wp.array2d[float],
    qvel: wp.array2d[float],
    qacc: wp.array2d[float],
    frozen: wp.array[int],
    rows: wp.array[int],
    contacts: wp.array[int],
    pairs: wp.array[int],
    overflow: wp.array[int],
    size_bits: int,
    step_index: wp.array[int],
    # outputs
    bad: wp.array[int],
    peak_rows: wp.array[int],
    peak_contacts: wp.array[int],
    first_overflow: wp.array[int],
) -> None:
    """Marks environments with a number that is not finite or too large, and keeps the largest numbers of rows and contacts."""
    w, i = wp.tid()
    if i == 0:
        step = step_index[0]
        if (overflow[w] & size_bits) != 0:
            wp.atomic_min(first_overflow, 0, step)
        # After a step that lacked rows, bodies fall into each other: those contacts do not count.
        if step <= first_overflow[0]:
            peak_rows[w] = wp.max(peak_rows[w], rows[w])
            if w == 0:
                peak_contacts[0] = wp.max(peak_contacts[0], wp.max(contacts[0], pairs[0]))
    if frozen[w] != 0:
        return
    value = float(0.0)
    reason = int(0)
    if i < nq:
        value = qpos[w, i]
        reason = BAD_QPOS
    elif i < nq + nv:
        value = qvel[w, i - nq]
        reason = BAD_QVEL
    else:
        value = qacc[w, i - nq - nv]
        reason = BAD_QACC
    # False for NaN.
    if wp.abs(value) <= MAX_STATE:
        return
    wp.atomic_or(bad, w, reason)


@wp.kernel(enable_backward=False)
def settle_state(
    nq: int,
    nv: int,
    bad: wp.array[int],
    step_index: wp.array[int],
    # inputs and outputs
    frozen: wp.array[int],
    diverged_step: wp.array[int],
    kept: wp.array2d[float],
    qpos: wp.array2d[float],
    qvel: wp.array2d[float],
    warmstart: wp.array2d[float],
    act: wp.array2d[float],
    qacc: wp.array2d[float],
) -> None:
    """Keeps the state of each environment; gives a diverged one the kept state back, and freezes it."""
    w, i = wp.tid()
    is_bad = bad[w] != 0
    if i == 0 and is_bad and frozen[w] == 0:
        frozen[w] = 1
        diverged_step[w] = step_index[0] - 1
    if i < nq:
        if is_bad:
            qpos[w, i] = kept[w, i]
        else:
            kept[w, i] = qpos[w, i]
    elif i < nq + nv:
        if is_bad:
            qvel[w, i - nq] = kept[w, i]
        else:
            kept[w, i] = qvel[w, i - nq]
    elif i < nq + nv + nv:
        if is_bad:
            warmstart[w, i - nq - nv] = kept[w, i]
            qacc[w, i - nq - nv] = kept[w, i]
        else:
            kept[w, i] = warmstart[w, i - nq - nv]
    else:
        if is_bad:
            act[w, i - nq - nv - nv] = kept[w, i]
        else:
            kept[w, i] = act[w, i - nq - nv - nv]


@wp.kernel(enable_backward=False)
def restore_state(
    nq: int,
    nv: int,
    kept: wp.array2d[float],
    frozen: wp.array[int],
    # outputs
    bad: wp.array[int],
    qpos: wp.array2d[float],
    qvel: wp.array2d[float],
    warmstart: wp.array2d[float],
    act: wp.array2d[float],
) -> None:
    """Gives all environments the kept state back."""
    w, i = wp.tid()
    if i == 0 and frozen[w] == 0:
        bad[w] = 0
    if i < nq:
        qpos[w, i] = kept[w, i]
    elif i < nq + nv:
        qvel[w, i - nq] = kept[w, i]
    elif i < nq + nv + nv:
        warmstart[w, i - nq - nv] = kept[w, i]
    else:
        act[w, i - nq - nv - nv] = kept[w, i]


# Numbers of the summary of a block of steps.
SUMMARY_OVERFLOW = wp.constant(0)
SUMMARY_ROWS = wp.constant(1)
SUMMARY_CONTACTS = wp.constant(2)
SUMMARY_DIVERGED = wp.constant(3)
# Number of environments with each bit of the overflow.
SUMMARY_BITS = wp.constant(4)
OVERFLOW_BITS = wp.constant(12)


@wp.kernel(enable_backward=False)
def summarize(
    overflow: wp.array[int],
    peak_rows: wp.array[int],
    peak_contacts: wp.array[int],
    diverged_step: wp.array[int],
    # outputs
    summary: wp.array[int],
) -> None:
    """Reduces the flags of all environments to a few numbers, so that a block of steps needs one small copy to the host."""
    w = wp.tid()
    bits = overflow[w]
    if bits != 0:
        wp.atomic_or(summary, SUMMARY_OVERFLOW, bits)
        for bit in range(OVERFLOW_BITS):
            if bits & (1 << bit):
                wp.atomic_add(summary, SUMMARY_BITS + bit, 1)
    wp.atomic_max(summary, SUMMARY_ROWS, peak_rows[w])
    if w == 0:
        summary[SUMMARY_CONTACTS] = peak_contacts[0]
    if diverged_step[w] >= 0:
        wp.atomic_add(summary, SUMMARY_DIVERGED, 1)


@wp.kernel(enable_backward=False)
def write_rows(envs: wp.array[int], values: wp.array2d[float], target: wp.array2d[float]) -> None:
    """Copies rows of `values` to the environments `envs`."""
    k, i = wp.tid()
    target[envs[k], i] = values[k, i]


@wp.kernel(enable_backward=False)
def write_flags(envs: wp.array[int], values: wp.array2d[float], target: wp.array2d[wp.bool]) -> None:
    """Copies rows of flags, 0 or 1, to the environments `envs`."""
    k, i = wp.tid()
    target[envs[k], i] = values[k, i] != 0.0


@wp.kernel(enable_backward=False)
def unfreeze(envs: wp.array[int], frozen: wp.array[int], bad: wp.array[int]) -> None:
    """Lets environments step again."""
    k = wp.tid()
    frozen[envs[k]] = 0
    bad[envs[k]] = 0


@wp.func
def rotate(quat: wp.quat, vector: wp.vec3) -> wp.vec3:
    """Rotates a vector by a quaternion in MuJoCo's order (w, x, y, z)."""
    axis = wp.vec3(quat[1], quat[2], quat[3])
    return vector + 2.0 * wp.cross(axis, wp.cross(axis, vector) + quat[0] * vector)


@wp.kernel(enable_backward=False)
def place_static_geoms(
    static_geoms: wp.array[int],
    geom_body: wp.array[int],
    geom_pos: wp.array2d[wp.vec3],
    geom_quat: wp.array2d[wp.quat],
    body_pos: wp.array2d[wp.vec3],
    body_quat: wp.array2d[wp.quat],
    # outputs
    geom_xpos: wp.array2d[wp.vec3],
    geom_xmat: wp.array2d[wp.mat33],
) -> None:
    """Moves geoms of bodies without degrees of freedom, which Warp places only once, to the poses of their bodies."""
    w, i = wp.tid()
    geom = static_geoms[i]
    body = geom_body[geom]
    quat = body_quat[w, body]
    geom_xpos[w, geom] = body_pos[w, body] + rotate(quat, geom_pos[w % geom_pos.shape[0], geom])
    local = geom_quat[w % geom_quat.shape[0], geom]
    x = rotate(quat, rotate(local, wp.vec3(1.0, 0.0, 0.0)))
    y = rotate(quat, rotate(local, wp.vec3(0.0, 1.0, 0.0)))
    z = rotate(quat, rotate(local, wp.vec3(0.0, 0.0, 1.0)))
    geom_xmat[w, geom] = wp.matrix_from_cols(x, y, z)


@wp.kernel(enable_backward=False)
def gather_contacts(
    count: wp.array[int],
    world: wp.array[int],
    geom: wp.array[wp.vec2i],
    dist: wp.array[float],
    pos: wp.array[wp.vec3],
    frame: wp.array[wp.mat33],
    address: wp.array2d[int],
    number: wp.array[int],
    force: wp.array[wp.spatial_vector],
    bad: wp.array[int],
    # outputs
    used: wp.array[int],
    rows: wp.array2d[float],
) -> None:
    """Collects the contacts with constraint rows; the last column is the number of the contact within its pair."""
    c = wp.tid()
    if c >= count[0]:
        return
    w = world[c]
    if address[c, 0] < 0 or bad[w] != 0:
        return
    k = wp.atomic_add(used, 0, 1)
    rows[k, 0] = float(w)
    rows[k, 1] = float(geom[c][0])
    rows[k, 2] = float(geom[c][1])
    rows[k, 3] = dist[c]
    for i in range(3):
        rows[k, 4 + i] = pos[c][i]
        rows[k, 16 + i] = force[c][i]
        for j in range(3):
            rows[k, 7 + 3 * i + j] = frame[c][i, j]
    rows[k, 19] = float(number[c])
