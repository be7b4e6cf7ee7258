"""Solve for the heights that balance `height_networks`, on the device; the host never waits.

One work-group takes all steps of a small network in one launch, and the steps on small levels of a
large one.  Launches after the solution has converged do nothing.  The preconditioner is multigrid,
not a cosine transform: weights differ by orders of magnitude, and with a preconditioner that
ignores them conjugate gradients do not converge.
"""

import math
from itertools import groupby
from typing import Any

import numpy as np

from tactograph.graph.backends.launch import DeviceArray, Launch
from tactograph.nodes.height.height_levels import (
    GAP_PIXELS,
    STEP_LIFT,
    STEP_REDO,
    STEP_RESTRICT,
    Step,
)
from tactograph.nodes.height.height_networks import HeightNetworks, Planes, Stack, Wants


class HeightSolver:
    """Conjugate gradients on the networks of a launch."""

    def __init__(self, run: Launch, networks: HeightNetworks) -> None:
        self._run, self._networks = run, networks
        self._levels, self._planes, self._parts = networks.levels, networks.planes, networks.parts
        self._group, self._by_parts = (run.group,), (self._parts.shape[0] * run.group,)
        self._distance = run.scratch((1,))

    def solve(
        self,
        stack: Stack,
        wants: Wants,
        height: DeviceArray,
        steps: int,
        enough: DeviceArray,
        number: int = 0,
        to: int = 0,
    ) -> None:
        """Improve height `to` for load `number` in place, as `conjugate_gradients` does."""
        run, planes, (rows, columns) = self._run, self._planes, stack.shape
        first, _, stride = stack.top.place
        by_rows = run.in_row_lanes(rows, stride)
        run.kernel("take_height", by_rows, height, planes.z, first, rows, columns, stride, to)
        self._unbalance(stack, wants, planes, number, 1)
        if self._is_small(stack.steps[0]):
            self._small_gradients(stack, planes, steps, enough, number, 1)
        else:
            self._gradients(stack, steps, enough, number)
        self._give_heights(stack, planes, height, to, 1)

    def solve_all(
        self, stack: Stack, wants: Wants, heights: DeviceArray, steps: int, enough: DeviceArray
    ) -> None:
        """Solve for all loads, starting from zero, side by side if there are few pixels."""
        run, (loads,) = self._run, enough.shape
        if not self._is_small(stack.steps[0]):
            size = math.prod(heights.shape)
            run.kernel("clear", run.in_lanes(size), heights, size)
            for number in range(loads):
                self.solve(stack, wants, heights, steps, enough, number, number)
            return
        last = self._levels[-1]
        base = stack.top.first - stack.top.stride
        apart = last.first + last.size + last.stride + 2 * GAP_PIXELS - base
        planes = self._networks.working_planes(loads * apart, base, apart)
        # The start is zero, and the gaps between levels have to be finite.
        for plane in (planes.height, planes.lifted, planes.z):
            run.kernel("clear", run.in_lanes(loads * apart), plane, loads * apart)
        self._unbalance(stack, wants, planes, 0, loads)
        self._small_gradients(stack, planes, steps, enough, 0, loads)
        self._give_heights(stack, planes, heights, 0, loads)

    def _unbalance(
        self, stack: Stack, wants: Wants, planes: Planes, number: int, loads: int
    ) -> None:
        """Compute the residual forces of the loads from `number` on, at the heights z."""
        run, (rows, columns), (first, _, stride) = self._run, stack.shape, stack.top.place
        run.kernel(
            "imbalance", run.in_row_lanes(loads * rows, stride), *self._networks.arguments(stack),
            self._networks.knot_tie, *wants, planes.z, planes.force, planes.lifted,
            first, rows, columns, stride, number, loads, wants.rise.shape[-1], *planes.place,
        )  # fmt: skip

    def _give_heights(
        self, stack: Stack, planes: Planes, heights: DeviceArray, to: int, loads: int
    ) -> None:
        run, (rows, columns), (first, _, stride) = self._run, stack.shape, stack.top.place
        run.kernel(
            "give_heights", run.in_row_lanes(loads * rows, columns), planes.z, heights,
            first, rows, columns, stride, to, loads, *planes.place,
        )  # fmt: skip

    def _small_gradients(
        self,
        stack: Stack,
        planes: Planes,
        steps: int,
        enough: DeviceArray,
        number: int,
        loads: int,
    ) -> None:
        """Take all steps if even the first level is small, with a work-group for each load."""
        run = self._run
        run.kernel(
            "small_gradients", (loads * run.group,), *self._cycle_there(stack, planes), 0,
            len(stack.steps), planes.direction, planes.moved, planes.z, enough, number, steps,
            *stack.top.place, *planes.place, local=(run.group,),
        )  # fmt: skip

    def _gradients(self, stack: Stack, steps: int, enough: DeviceArray, number: int) -> None:
        """Take the steps if the first level is large."""
        # The state before the first cycle; springs.clh explains the four values.
        gain = self._run.put(np.array([0, 0, -1, 1], np.float32))
        step = self._run.capture(lambda: self._step(stack, gain, enough, number))
        for _ in range(steps + 1):
            step()

    def _step(self, stack: Stack, gain: DeviceArray, enough: DeviceArray, number: int) -> None:
        """Take one step and then a cycle; before the first step only the cycle."""
        run, there, planes = self._run, stack.top.place, self._planes
        run.kernel(
            "turn", self._by_parts, *self._networks.arguments(stack), planes.height,
            planes.direction, planes.moved, self._parts, *there, gain, local=run.part,
        )  # fmt: skip
        group = self._group
        run.kernel("reach", group, self._parts, self._distance, gain, local=group)
        run.kernel(
            "advance", run.in_lanes(stack.top.size), *self._networks.arguments(stack),
            planes.direction, planes.moved, planes.z, planes.force, planes.lifted, self._distance,
            *there, gain,
        )  # fmt: skip
        self._cycle(stack, gain)
        run.kernel("end_step", group, self._parts, gain, enough, number, local=group)

    def _cycle(self, stack: Stack, gain: DeviceArray) -> None:
        """Run one multigrid cycle: from the force on the (large) first level to its height."""
        run, (*steps, _) = self._run, stack.steps
        at = 0
        for are_small, group in groupby(steps, self._is_small):
            together = [*group]
            if are_small:
                there, end = self._cycle_there(stack, self._planes), at + len(together)
                run.kernel("small_levels", (run.group,), *there, at, end, gain, local=(run.group,))
            else:
                for step in together:
                    self._large_step(stack, step, gain)
            at += len(together)
        run.kernel(
            "smooth_and_sum", self._by_parts, *self._networks.arguments(stack),
            *self._planes[:3], self._parts, *stack.top.place, gain, local=run.part,
        )  # fmt: skip

    def _is_small(self, step: Step) -> bool:
        return self._networks.is_small(self._levels[step.level])

    def _cycle_there(self, stack: Stack, planes: Planes) -> tuple[Any, ...]:
        """Arguments of the kernels for small levels."""
        networks = self._networks
        there = networks.levels_there, stack.steps_there
        return *networks.arguments(stack), *planes[:4], *there

    def _large_step(self, stack: Stack, step: Step, gain: DeviceArray) -> None:
        run, level, network = self._run, self._levels[step.level], self._networks.arguments(stack)
        coarse, (force, height, lifted, saved, *_) = self._levels[step.level + 1], self._planes
        here, blocks = run.in_lanes(level.size), run.in_lanes(coarse.size)
        if step.action == STEP_RESTRICT:
            run.kernel(
                "restrict_level", blocks,
                *network, force, lifted, *level.place, *coarse.place, gain,
            )  # fmt: skip
        elif step.action == STEP_REDO:
            run.kernel(
                "redo_level", here,
                *network, force, height, lifted, saved, *level.place, gain,
            )  # fmt: skip
        elif step.action == STEP_LIFT:
            run.kernel(
                "lift_level", blocks, height, lifted, saved, int(step.twice),
                *level.place, *coarse.place, gain,
            )  # fmt: skip
        else:
            run.kernel(
                "smooth_level", here,
                *network, force, height, lifted, *level.place, gain,
            )  # fmt: skip
