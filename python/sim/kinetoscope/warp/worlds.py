"""Arrays and kernels of all environments on a device."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from typing import Any

import mujoco_warp as mjw
import numpy as np
from numpy.typing import NDArray
import warp as wp

from . import kernels, sizes
from .errors import DeviceError, UnsupportedSceneError
from .model import Scene

# Arrays of the state and the inputs. They stay the same arrays when others grow, so views of users stay valid.
STATE = ("qpos", "qvel", "qacc_warmstart", "act", "mocap_pos", "mocap_quat", "eq_active")
INPUTS = ("ctrl", "xfrc_applied")
DRIVE_INPUTS = ("stiffness", "damping", "max_effort", "target_position", "target_velocity", "feedforward")
# Quantities of the captured step that `read` returns.
MOTION = ("xpos", "xquat", "subtree_com", "cvel", "cacc")
WRENCHES = ("cfrc_int",)
CAPTURES = ("contacts", "motion", "wrenches")
CONTACT_COLUMNS = 20
# Later than every step.
NO_STEP = 2**31 - 1

ROW_BITS = int(mjw.OverflowType.NEFC | mjw.OverflowType.NJMAX_NNZ)
CONTACT_BITS = int(mjw.OverflowType.BROADPHASE | mjw.OverflowType.NARROWPHASE | mjw.OverflowType.CCD)
SIZE_BITS = ROW_BITS | CONTACT_BITS
REASONS = ((4, "qacc"), (2, "qvel"), (1, "qpos"))


@dataclasses.dataclass(frozen=True)
class Summary:
    """Flags of all environments after a block of steps."""

    overflow: int
    rows: int
    contacts: int
    diverged: int
    bits: tuple[int, ...]


class Worlds:
    """A batch of environments of one scene. All methods run with the device as the current device of Warp."""

    def __init__(self, scene: Scene, device: Any, num_envs: int) -> None:
        self.scene, self.device, self.num_envs = scene, device, num_envs
        mjm = scene.model
        self.nq, self.nv = mjm.nq, mjm.nv
        if self.nv == 0:
            raise UnsupportedSceneError("the scene has no degree of freedom; expected a robot or an object that moves")
        try:
            self.model = mjw.put_model(mjm)
        except (NotImplementedError, ValueError) as error:
            raise UnsupportedSceneError(f"MuJoCo Warp does not support the scene: {error}") from error
        # It would print a line for each environment and step.
        self.model.opt.warn_overflow = 0
        # Newton starts from the accelerations of the last step; those without constraints, and their factorization, are not read.
        self.model.opt.run_qacc_smooth = False
        self.rows, self.contacts = sizes.initial_sizes(mjm)
        self.data = self.make_data(self.rows, self.contacts)
        n, drives, damped = num_envs, len(scene.dof), len(scene.damped)
        self.kept_arrays = {name: getattr(self.data, name) for name in (*STATE, *INPUTS, "qacc", "time")}
        table = np.full(self.nv, -1, np.int32)
        self.dof_drive, self.dof_damped = (table.copy() for _ in range(2))
        self.dof_drive[scene.dof], self.dof_damped[scene.damped] = np.arange(drives), np.arange(damped)
        self.dof_drive, self.dof_damped = (wp.array(x, dtype=int) for x in (self.dof_drive, self.dof_damped))
        self.drive_dof, self.drive_qpos, self.drive_ctrl = (wp.array(x, dtype=int) for x in (scene.dof, scene.qpos, scene.ctrl))
        initial = {"stiffness": scene.stiffness, "damping": scene.damping, "max_effort": scene.max_effort}
        zero = np.zeros(drives)
        self.drives = {name: self.repeated(initial.get(name, zero)) for name in DRIVE_INPUTS}
        self.viscous_damping = self.repeated(scene.viscous_damping)
        self.user_force = wp.zeros((n, self.nv), dtype=float)
        self.effort = wp.zeros((n, drives), dtype=float)
        self.frozen, self.bad, self.peak_rows = (wp.zeros(n, dtype=int) for _ in range(3))
        self.diverged_step = wp.full(n, -1, dtype=int)
        self.step_index, self.peak_contacts, self.first_overflow = (wp.zeros(1, dtype=int) for _ in range(3))
        self.summary = wp.zeros(int(kernels.SUMMARY_BITS) + int(kernels.OVERFLOW_BITS), dtype=int)
        self.state_width = self.nq + 2 * self.nv + mjm.na
        self.kept = wp.zeros((n, self.state_width), dtype=float)
        self.block = [wp.empty_like(array) for array in self.block_arrays()]
        is_static = (mjm.body_weldid == 0) & (mjm.body_mocapid[mjm.body_rootid] < 0)
        self.static_geoms = wp.array(np.flatnonzero(is_static[mjm.geom_bodyid]), dtype=int)
        self.captured: dict[str, wp.array] = {}
        self.contact_ids: wp.array | None = None
        self.graphs: dict[tuple[str, ...], wp.Graph] = {}
        self.is_forward_needed = True
        self.are_bodies_moved = False

    def repeated(self, numbers: NDArray[Any]) -> wp.array:
        """The same row of numbers for each environment."""
        return wp.array(np.tile(np.asarray(numbers, np.float32), (self.num_envs, 1)), dtype=float)

    def make_data(self, rows: int, contacts: int) -> mjw.Data:
        """Data with room for `rows` constraint rows and `contacts` contacts of each environment."""
        try:
            return mjw.make_data(self.scene.model, nworld=self.num_envs, njmax=rows, nconmax=contacts)
        except (RuntimeError, MemoryError) as error:
            raise DeviceError(
                f"the device {self.device.alias} has not enough memory for {self.num_envs} environments with up to {contacts} "
                f"contacts and {rows} constraint rows each ({error}); expected fewer environments, or fewer contacts in each"
            ) from error

    def block_arrays(self) -> list[wp.array]:
        """Arrays that a step changes and the next one needs."""
        return [self.kept, self.frozen, self.bad, self.diverged_step, self.step_index, self.effort]

    # Operations of a step ------------------------------------------------------------------------------------------

    def apply_inputs(self) -> None:
        """Writes forces and drive rows."""
        d, rows = self.data, self.data.efc
        wp.launch(
            kernels.apply_inputs,
            dim=(self.num_envs, self.nv),
            inputs=[
                self.model.opt.timestep, self.dof_drive, self.dof_damped, self.drive_qpos, self.drive_ctrl,
                *(self.drives[name] for name in DRIVE_INPUTS),
                self.viscous_damping, self.user_force, d.qpos, d.qvel, d.dof_frictionadr, self.frozen,
            ],
            outputs=[
                d.ctrl, d.qfrc_applied, rows.D, rows.aref, rows.frictionloss, d.nefc, d.ne, d.nf, d.nl, self.step_index,
            ],
        )

    def check(self) -> None:
        """Marks environments whose new state is bad."""
        d = self.data
        wp.launch(
            kernels.check_state,
            dim=(self.num_envs, self.nq + 2 * self.nv),
            inputs=[
                self.nq, self.nv, d.qpos, d.qvel, d.qacc, self.frozen, d.nefc, d.nacon, d.ncollision, d.overflow, SIZE_BITS,
                self.step_index,
            ],
            outputs=[self.bad, self.peak_rows, self.peak_contacts, self.first_overflow],
        )

    def settle(self) -> None:
        """Keeps good states, and restores bad ones."""
        d = self.data
        wp.launch(
            kernels.settle_state,
            dim=(self.num_envs, self.state_width),
            inputs=[self.nq, self.nv, self.bad, self.step_index],
            outputs=[self.frozen, self.diverged_step, self.kept, d.qpos, d.qvel, d.qacc_warmstart, d.act, d.qacc],
        )

    def restore(self) -> None:
        """Gives all environments the kept state back."""
        d = self.data
        wp.launch(
            kernels.restore_state,
            dim=(self.num_envs, self.state_width),
            inputs=[self.nq, self.nv, self.kept, self.frozen],
            outputs=[self.bad, d.qpos, d.qvel, d.qacc_warmstart, d.act],
        )

    def read_efforts(self) -> None:
        """Stores the efforts of drives."""
        if self.effort.shape[1] == 0:
            return
        wp.launch(
            kernels.read_efforts,
            dim=self.effort.shape,
            inputs=[
                self.drive_dof, *(self.drives[name] for name in ("stiffness", "damping", "max_effort", "feedforward")),
                self.data.dof_frictionadr, self.data.efc.force, self.bad,
            ],
            outputs=[self.effort],
        )

    def capture(self, wanted: tuple[str, ...]) -> None:
        """Copies solved quantities after a step, before the next forward pass replaces them."""
        d = self.data
        names = (*(MOTION if "motion" in wanted else ()), *(WRENCHES if "wrenches" in wanted else ()))
        for name in names:
            wp.copy(self.captured[name], getattr(d, name))
        if "contacts" in wanted:
            mjw.contact_force(self.model, d, self.contact_ids, False, self.captured["forces"])
            self.captured["used"].zero_()
            c = d.contact
            wp.launch(
                kernels.gather_contacts,
                dim=d.naconmax,
                inputs=[
                    d.nacon, c.worldid, c.geom, c.dist, c.pos, c.frame, c.efc_address, c.geomcollisionid, self.captured["forces"],
                    self.bad,
                ],
                outputs=[self.captured["used"], self.captured["contacts"]],
            )

    def step2(self, wanted: tuple[str, ...]) -> None:
        """Second half of a step, with accelerations and forces of bodies if they are captured."""
        self.apply_inputs()
        # Inside the step, the velocities are still those at its start.
        self.model.opt.run_rne_postconstraint = "motion" in wanted or "wrenches" in wanted
        mjw.step2(self.model, self.data)
        self.model.opt.run_rne_postconstraint = False
        self.check()

    def step_once(self, wanted: tuple[str, ...]) -> None:
        """One step after a forward pass, and the forward pass of the new state."""
        self.step2(wanted)
        self.settle()
        self.read_efforts()
        self.capture(wanted)
        mjw.step1(self.model, self.data)

    def solve_once(self, wanted: tuple[str, ...]) -> None:
        """Solves the current state, which stays the same, as do efforts."""
        self.step2(wanted)
        self.capture(wanted)
        self.restore()
        mjw.step1(self.model, self.data)

    def forward_once(self, _: tuple[str, ...]) -> None:
        """Forward pass of a state that was written."""
        m, d = self.model, self.data
        self.settle()
        if self.are_bodies_moved and self.static_geoms.size > 0:
            mjw.kinematics(m, d)
            wp.launch(
                kernels.place_static_geoms,
                dim=(self.num_envs, self.static_geoms.size),
                inputs=[self.static_geoms, m.geom_bodyid, m.geom_pos, m.geom_quat, d.xpos, d.xquat],
                outputs=[d.geom_xpos, d.geom_xmat],
            )
        mjw.step1(m, d)

    # Graphs --------------------------------------------------------------------------------------------------------

    def graph(self, operation: str, wanted: tuple[str, ...] = ()) -> wp.Graph:
        """Graph of `step_once`, `solve_once` or `forward_once`, recorded at the first use."""
        key = (operation, *wanted)
        if key not in self.graphs:
            self.prepare_capture(wanted)
            run: Callable[[tuple[str, ...]], None] = getattr(self, operation)
            # Kernels cannot be loaded while an older driver records. The run changes the state.
            arrays = [*self.block_arrays(), *self.kept_arrays.values(), self.peak_rows, self.peak_contacts]
            saved = [wp.clone(array) for array in arrays]
            run(wanted)
            for array, before in zip(arrays, saved, strict=True):
                wp.copy(array, before)
            self.data.overflow.zero_()
            with wp.ScopedCapture(self.device) as capture:
                run(wanted)
            self.graphs[key] = capture.graph
            self.is_forward_needed = True
        return self.graphs[key]

    def prepare_capture(self, wanted: tuple[str, ...]) -> None:
        """Makes the arrays of captured quantities."""
        names = (*(MOTION if "motion" in wanted else ()), *(WRENCHES if "wrenches" in wanted else ()))
        for name in names:
            if name not in self.captured:
                self.captured[name] = wp.zeros_like(getattr(self.data, name))
        count = self.data.naconmax
        if "contacts" in wanted and (self.contact_ids is None or self.contact_ids.size != count):
            self.contact_ids = wp.array(np.arange(count), dtype=int)
            self.captured["forces"] = wp.zeros(count, dtype=wp.spatial_vector)
            self.captured["contacts"] = wp.zeros((count, CONTACT_COLUMNS), dtype=float)
            self.captured["used"] = wp.zeros(1, dtype=int)

    def run(self, operation: str, count: int, wanted: tuple[str, ...] = ()) -> Summary:
        """Runs `count` operations from a forward pass, the last one with the capture `wanted`."""
        self.forward()
        graphs = [self.graph(operation)] * (count - 1) + [self.graph(operation, wanted)]
        # Recording a graph changed what the forward pass computed.
        self.forward()
        self.keep_block()
        self.data.overflow.zero_()
        self.peak_rows.zero_()
        self.peak_contacts.zero_()
        self.first_overflow.fill_(NO_STEP)
        for graph in graphs:
            wp.capture_launch(graph)
        return self.summarize()

    def forward(self) -> None:
        """Forward pass, if the state was written."""
        if self.is_forward_needed:
            wp.capture_launch(self.graph("forward_once"))
            self.is_forward_needed = False

    def summarize(self) -> Summary:
        """Flags of the last block. Waits for the device."""
        self.summary.zero_()
        wp.launch(
            kernels.summarize,
            dim=self.num_envs,
            inputs=[self.data.overflow, self.peak_rows, self.peak_contacts, self.diverged_step],
            outputs=[self.summary],
        )
        numbers = [int(number) for number in self.summary.numpy()]
        return Summary(numbers[0], numbers[1], numbers[2], numbers[3], tuple(numbers[4:]))

    def keep_block(self) -> None:
        """Keeps what a block of steps changes."""
        for kept, array in zip(self.block, self.block_arrays(), strict=True):
            wp.copy(kept, array)

    def restore_block(self) -> None:
        """Returns to the start of the block."""
        for kept, array in zip(self.block, self.block_arrays(), strict=True):
            wp.copy(array, kept)
        self.restore()
        self.is_forward_needed = True

    def grow(self, summary: Summary) -> None:
        """Enlarges the arrays that were too small, and returns to the start of the block.

        Raises DeviceError without enough memory.
        """
        self.restore_block()
        rows, contacts = self.rows, self.contacts
        if summary.overflow & ROW_BITS:
            rows = sizes.enlarged(rows, summary.rows)
        if summary.overflow & CONTACT_BITS:
            contacts = sizes.enlarged(contacts, math.ceil(summary.contacts / self.num_envs))
        sizes.check_memory(self.data, self.device, rows, contacts)
        self.resize(rows, contacts)

    def resize(self, rows: int, contacts: int) -> None:
        """Replaces the arrays for constraint rows and contacts. The state and the inputs stay."""
        self.graphs.clear()
        # Freed before the larger arrays are made.
        del self.data
        self.data = self.make_data(rows, contacts)
        for name, array in self.kept_arrays.items():
            setattr(self.data, name, array)
        self.rows, self.contacts = rows, contacts
        self.is_forward_needed = True

    def begin_call(self) -> None:
        """Forgets divergences that were reported."""
        self.diverged_step.fill_(-1)
        self.step_index.zero_()

    def divergences(self) -> list[tuple[int, int, str]]:
        """Environments that diverged since `begin_call`: environment, step and reason."""
        steps, bits = self.diverged_step.numpy(), self.bad.numpy()
        envs = np.flatnonzero(steps >= 0)
        return [(int(w), int(steps[w]), next(name for bit, name in REASONS if bits[w] & bit)) for w in envs]
