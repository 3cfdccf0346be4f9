"""The stages on a Motion, block after block, so that no stage keeps all samples."""

from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from gcode2krl import collision, compliance, cutting, krc4, program, robot
from gcode2krl.arrays import Floats, Ints32
from gcode2krl.cell import Cell
from gcode2krl.clearance import ArmInStock, Beside, Inside, moves_watched_at_targets, watch_of
from gcode2krl.compiled.threads import ahead, in_threads
from gcode2krl.errors import Issue, RefusedError
from gcode2krl.pilot import to_pilot_frame
from gcode2krl.pose.chatter import ChatterWatch
from gcode2krl.prediction.limits import AccelerationLimit, DeflectionLimit, ForceLimits
from gcode2krl.tables import (
    Clearance,
    Deflection,
    Forces,
    Gathered,
    Joints,
    Motion,
    PilotForce,
    Targets,
    Toolpath,
    blocks_of,
    joined,
    rows_of,
)

_SLOWING_ROUNDS = 3
_LEAST_SHARE = 1.0 + 1e-3
"""Joint speed over its limit above which a move is slowed down."""


@dataclass(frozen=True)
class Planned:
    """A motion that is planned, and what was seen on a first way along it."""

    course: krc4.Course
    issues: tuple[Issue, ...]
    outlook: Callable[[], cutting.Outlook]
    """Raises `RefusedError` where the motion cannot be cut out of one field."""
    kept: "Kept | None"
    follower: robot.Follower | None
    """What knows the joints of the samples, where they were needed and are not kept."""

    def samples(self) -> "Kept":
        """Return the samples of a motion that was planned to keep them."""
        if self.kept is None:
            raise AssertionError("samples that are asked for are kept")
        return self.kept


class Kept(NamedTuple):
    """The samples of a motion, where they were asked for."""

    motion: Motion
    q_rad: Floats | None
    """(m, 6) None where joints were not needed."""
    qd_rad_s: Floats | None
    clearance: Clearance | None
    """None where the cell describes nothing that may hit or be hit."""

    def joints(self, cell: Cell) -> Joints:
        """Return the joints at the samples, solved here where the planning did not need them."""
        if self.q_rad is None or self.qd_rad_s is None:
            return robot.follow_motion(self.motion, cell)
        return robot.joints_from_angles(self.motion, self.q_rad, self.qd_rad_s, cell)


def plan_course(
    targets: Targets, cell: Cell, dt_s: float, *, keeps: bool = False, watches: bool = True
) -> Planned:
    """Plan the motion that the controller will command; see `pipeline.plan_motion`.

    Only where it ``keeps`` them are the samples of the first way along it returned, and only where it
    ``watches`` are there collisions among the findings.
    """
    chain = krc4.build_chain(targets, cell)
    profile = krc4.plan(chain, cell, both_laws=True)
    simplify_mm = targets.simplified.tolerance_mm if targets.simplified is not None else None
    free = krc4.plan(chain, cell, look_ahead=False)
    findings: list[Callable[[], tuple[Issue, ...]]] = [
        lambda: krc4.motion_issues(chain, profile, free, cell, simplify_mm),
        lambda: krc4.corner_issues(targets, chain, profile, free, cell),
    ]
    issues = [issue for issues in in_threads(lambda finding: finding(), findings) for issue in issues]
    slower, slowed, planned_s = chain, chain.speed_mm_s, profile.total_s
    for trial in range(_SLOWING_ROUNDS + 1):
        course = krc4.Course(targets, slower, profile, cell, dt_s)
        is_last = trial == _SLOWING_ROUNDS
        judges = _Judges(joints=not is_last, collisions=watches)
        seen = _seen_along(course, targets, chain, cell, judges, keeps=keeps)
        if seen.share is None or seen.share.max(initial=0.0) <= _LEAST_SHARE:
            break
        slowed = slowed / np.maximum(seen.share, 1.0)
        slower = krc4.with_speed(chain, slowed)
        profile = krc4.plan(slower, cell)
        lost_s = max(profile.total_s - planned_s, 0.0)  # slower moves may round their corners faster
        worst = int(np.argmin(slowed / chain.speed_mm_s))
        issues = [issue for issue in issues if issue.code != "joint-speed"]
        sentence = f"joint speed limits slow the robot down: {lost_s:.2f} s more, most at this line"
        remedy = "lower F there, move the part, or turn the tool about its axis"
        issues.append(Issue("warning", "joint-speed", int(chain.source_line[worst]), sentence, remedy))
    issues += [*seen.acceleration.issues(), *seen.contacts]
    kept = seen.kept
    if kept is not None:
        kept = kept._replace(motion=replace(kept.motion, issues=tuple(issues)))
    return Planned(course, tuple(issues), seen.watch.outlook, kept, None if keeps else seen.follower)


class _Seen(NamedTuple):
    """What is seen on a way along a motion."""

    share: Floats | None
    """(n,) largest joint speed over its limit of each move of the chain; None where it is not judged."""
    acceleration: AccelerationLimit
    watch: cutting.Watch
    contacts: tuple[Issue, ...]
    """Collisions, and what comes near; see `collision`."""
    kept: Kept | None
    follower: robot.Follower | None


class _Judges(NamedTuple):
    """What is looked at on a way along a motion."""

    joints: bool
    collisions: bool


def _seen_along(
    course: krc4.Course, targets: Targets, chain: krc4.Chain, cell: Cell, judges: "_Judges", *, keeps: bool
) -> _Seen:
    """Go along a motion, and look at joint speeds, accelerations, tools and collisions."""
    line = _line_of_move(targets, chain)
    acceleration, watch = AccelerationLimit(cell, course.dt_s, course.count), cutting.Watch()
    judges_joints = judges.joints and cell.robot.speeds.qd_deg_s is not None and course.moves > 0
    watches = judges.collisions and course.moves > 0
    guard = _Guard.over(targets, cell, line, keeps=keeps) if watches else None
    follower = None
    if judges_joints or guard is not None:
        follower = follower_of(course, cell, remembers=not keeps)
    share = np.zeros(len(line)) if judges_joints else None
    gathered, waiting = Gathered[Motion](course.count), np.zeros((2, 0), dtype=np.int32)
    carried = np.zeros((0, 6))
    angles = np.empty((2, course.count if keeps and follower is not None else 0, 6))
    solved = 0
    with ahead(course.blocks()) as blocks:
        for motion, ends in blocks:
            acceleration.take(motion, line[motion.move])
            watch.take(motion)
            if follower is not None:
                q, qd = follower.take(motion, ends)
                waiting = np.concatenate([waiting, [motion.move, motion.tool]], axis=1)
                move, tool = waiting[:, : len(q)]
                waiting, around = waiting[:, len(q) :], np.concatenate([carried, motion.external])
                carried = around[len(q) :]
                if share is not None:
                    robot.raise_shares(share, qd, move, cell)
                if guard is not None:
                    guard.take(q, move, tool, around[: len(q)])
                if keeps:
                    angles[:, solved : solved + len(q)] = q, qd
                    solved += len(q)
            if keeps:
                gathered.take(motion)
    clearance = guard.clearance() if guard is not None and keeps else None
    q_rad, qd_rad_s = angles if follower is not None else (None, None)
    kept = Kept(gathered.table(), q_rad, qd_rad_s, clearance) if keeps else None
    contacts = guard.watch.issues() if guard is not None else ()
    if share is not None:
        share[moves_watched_at_targets(targets)] = 0.0  # a PTP keeps to the joint speeds by itself
    by_move = share[chain.move] if share is not None else None
    return _Seen(by_move, acceleration, watch, contacts, kept, follower)


class _Guard:
    """What looks for collisions along a motion."""

    def __init__(self, watch: collision.Watch, line: Ints32, elsewhere: Ints32, *, keeps: bool) -> None:
        """Take the lines (n,) of the rows of the Toolpath, and the rows that are watched at their targets."""
        self.watch, self._line, self._elsewhere = watch, line, elsewhere
        self._kept: list[tuple[Floats, Ints32]] | None = [] if keeps else None

    @classmethod
    def over(cls, targets: Targets, cell: Cell, line: Ints32, *, keeps: bool) -> "_Guard | None":
        watch = watch_of(cell, tells=keeps)
        if watch is None:
            return None
        return cls(watch, line, moves_watched_at_targets(targets), keeps=keeps)

    def take(self, q_rad: Floats, move: Ints32, tool: Ints32, external: Floats) -> None:
        """Go on along samples (m) with their joints and external axes."""
        elsewhere = np.isin(move, self._elsewhere)
        if elsewhere.any():
            q_rad = np.where(elsewhere[:, None], np.nan, q_rad)
        if len(q_rad):
            watched = self.watch.samples(q_rad, np.ascontiguousarray(tool), self._line[move], external)
            if self._kept is not None:
                self._kept.append(watched)

    def clearance(self) -> Clearance:
        """Return the clearances of all samples."""
        gaps, near = zip(*(self._kept or []), strict=True)
        link, obstacle = np.concatenate(near).T
        return Clearance(
            clearance_mm=np.concatenate(gaps),
            clearance_link=np.ascontiguousarray(link),
            clearance_obstacle=np.ascontiguousarray(obstacle),
            links=tuple(self.watch.links),
            obstacles=tuple(self.watch.obstacles),
        )


def follower_of(course: krc4.Course, cell: Cell, *, remembers: bool = False) -> robot.Follower:
    """Return what solves the joints along a motion, see `robot.Follower`."""
    rows = robot.trial_rows(course.count)
    return robot.Follower(course.at(rows), rows, course.dt_s, cell, remembers=remembers)


def _line_of_move(targets: Targets, chain: krc4.Chain) -> Ints32:
    """Return the G-code line of each row of the Toolpath up to the last that moves."""
    programmed = targets.move >= 0
    line = np.zeros(int(max(targets.move.max(), chain.move.max(initial=0))) + 1, dtype=np.int32)
    line[targets.move[programmed]] = targets.source_line[programmed]
    return line


Samples = tuple[Motion, Floats, Floats, bool]
"""The next samples (m) of a motion, angles and speeds of those of them and before them that are known, and
whether the motion ends with them; see `Loads.along`."""


class Block(NamedTuple):
    """Samples that have passed all stages."""

    motion: Motion
    line: Ints32
    """(m,) line of the G-code."""
    forces: Forces
    deflection: Deflection | None
    q_rad: Floats


@dataclass(frozen=True)
class Outcome:
    """What was found of the forces of a whole motion."""

    force_issues: tuple[Issue, ...] | None
    """None where there are no forces."""
    deflection_issues: tuple[Issue, ...] | None
    """None where there is no deflection."""
    skipped: tuple[Issue, ...]
    """Why a stage did not run."""


class Loads:
    """Forces and deflection along a motion that comes block after block, and what is found of them."""

    def __init__(
        self,
        toolpath: Toolpath,
        cell: Cell,
        outlook: Callable[[], cutting.Outlook],
        dt_s: float,
        *,
        has_peaks: bool = True,
        ways: Sequence[Beside] = (),
    ) -> None:
        """Set up the stock; raises `NotUnderstoodError` where it cannot be read.

        Without peaks, ``peak_N`` of the forces is their mean: no figure of a program depends on it.
        ``ways`` are those that the motion does not show, to be held against the stock.
        """
        self._toolpath, self._cell = toolpath, cell
        self._milling: cutting.Milling | None = None
        self._arm: ArmInStock | None = None
        self._skipped: tuple[Issue, ...] = ()
        self._missing = compliance.missing_stiffness(cell)
        self._force_limits, self._deflection_limit = (
            ForceLimits(cell),
            DeflectionLimit(cell, "" if self._missing is not None else compliance.stiffness(cell).assumed),
        )
        self._chatter = ChatterWatch(toolpath, cell)
        self._cuts = np.zeros(len(toolpath), dtype=np.bool_)
        self._waiting: tuple[Motion, Floats, Floats] | None = None
        self.count = 0
        """Samples that are done."""
        if cell.material is None:
            remedy = "give [material] in the cell"
            self._skipped = (Issue("note", "no-forces", 0, "no forces: the cell names no material", remedy),)
            return
        try:
            self._milling = cutting.Milling(toolpath, cell, outlook(), dt_s, has_peaks=has_peaks)
            self._arm = ArmInStock.of(toolpath, cell, self._milling, ways)
        except RefusedError as error:
            self._skipped = tuple(replace(issue, severity="warning") for issue in error.issues)

    def along(self, samples: Iterable[Samples]) -> Generator[Block, None, None]:
        """Yield the next samples once they are done: while a block is judged the next is cut, and so on.

        The joints may be those of fewer samples, as long as they follow each other. Whoever takes the blocks
        closes this generator, whatever happens between: it has threads (`threads.ahead`).
        """
        milling, arm = self._milling, self._arm
        if milling is None:
            return

        def approached() -> Generator[tuple[Samples, Inside | None, cutting.Approach], None, None]:
            for block in samples:
                for part, inside in arm.divided(block) if arm is not None else [(block, None)]:
                    yield part, inside, milling.approached(part[0], part[3])

        def touched() -> Generator[tuple[Samples, cutting.Contact], None, None]:
            with ahead(approached()) as blocks:
                for block, inside, approach in blocks:
                    if arm is not None and inside is not None:
                        arm.judge(inside)
                    yield block, milling.touched(approach)

        with ahead(touched()) as blocks:
            for block, contact in blocks:
                yield self._done(block, milling.loaded(contact))

    def _done(self, samples: Samples, forces: Forces) -> Block:
        motion, q_rad, qd_rad_s, _ = samples
        if self._waiting is not None:
            old, q_old, qd_old = self._waiting
            motion = joined(old, motion)
            q_rad, qd_rad_s = np.concatenate([q_old, q_rad]), np.concatenate([qd_old, qd_rad_s])
        count = len(forces)
        self.count += count
        tail = rows_of(motion, count, len(motion))
        self._waiting = (tail, q_rad[count:].copy(), qd_rad_s[count:].copy())
        return self._judged(rows_of(motion, 0, count), q_rad[:count], qd_rad_s[:count], forces)

    def _judged(self, motion: Motion, q_rad: Floats, qd_rad_s: Floats, forces: Forces) -> Block:
        line = self._toolpath.source_line[np.clip(motion.move, 0, len(self._toolpath) - 1)]
        self._force_limits.take(forces, line)
        self._cuts[motion.move[np.isfinite(forces.phi_rad[:, 0]) & (motion.move > 0)]] = True
        if self._force_limits.absurd is None:
            self._chatter.take(motion, q_rad, forces, line)
        deflection = None
        if self._missing is None and self._force_limits.absurd is None:
            with np.errstate(all="ignore"):  # an absurd result becomes a finding
                deflection = compliance.deflect_at(q_rad, qd_rad_s, motion.external, forces, self._cell)
            reached = np.isfinite(q_rad[:, 0])  # a pose out of reach has no angle at all
            self._deflection_limit.take(deflection, reached, line)
        return Block(motion, line, forces, deflection, q_rad)

    def outcome(self) -> Outcome:
        """Return what was found, once the motion has ended."""
        if self._milling is None:
            return Outcome(None, None, self._skipped)
        issues = self._milling.issues()
        if self._arm is not None:
            self._arm.finish()
            issues = (*issues, *self._arm.issues())
        limits, bent = self._force_limits, self._deflection_limit
        if limits.absurd is not None:
            return Outcome(None, None, (*issues, limits.absurd))
        guessed = any(issue.code == "stock-guessed" for issue in issues)
        feeds = program.feeds_per_tooth(self._toolpath, self._cell, self._cuts)
        force_issues = (*issues, *limits.issues(guessed), *feeds, *self._chatter.issues())
        if self._missing is not None:
            return Outcome(force_issues, None, (replace(self._missing, severity="note"),))
        if bent.absurd is not None:
            return Outcome(force_issues, None, (bent.absurd,))
        assumed = compliance.assumed_stiffness(self._cell, "note")
        return Outcome(force_issues, (*bent.issues(), *([assumed] if assumed is not None else ())), ())


class PilotSamples:
    """What the pilot force of a program is made from, gathered from samples that have passed all stages."""

    def __init__(self, cell: Cell, count: int) -> None:
        """Take how many samples will come."""
        self._cell, self._gathered = cell, Gathered[PilotForce](count)

    def take(self, motion: Motion, line: Ints32, forces: Forces, deflection: Deflection | None) -> None:
        """Add the next samples."""
        force_N = self._turned(forces.force_base_N, motion)
        bent_mm = np.broadcast_to(np.nan, force_N.shape)
        if deflection is not None:
            bent_mm = self._turned(deflection.deflection_base_mm, motion)
        samples = PilotForce(
            time_s=motion.time_s,
            path_mm=motion.path_mm,
            speed_mm_s=motion.speed_mm_s,
            acceleration_mm_s2=motion.acceleration_mm_s2,
            line=line,
            force_N=force_N,
            deflection_mm=bent_mm,
        )
        self._gathered.take(samples)

    def _turned(self, vectors: Floats, motion: Motion) -> Floats:
        return to_pilot_frame(vectors, motion.rotation, motion.tool, self._cell) if len(motion) else vectors

    def force(self, with_deflection: bool) -> PilotForce:
        """Return all samples; a deflection that is not known is NaN."""
        force = self._gathered.table()
        if with_deflection:
            return force
        return replace(force, deflection_mm=np.broadcast_to(np.nan, force.deflection_mm.shape))


def blocks_with_joints(planned: Planned, cell: Cell) -> Iterator[Samples]:
    """Yield the blocks of a motion with the joints and speeds that are known so far, see `Loads.along`."""
    course, known = planned.course, planned.follower
    follower = known.again() if known is not None else follower_of(course, cell)
    for motion, ends in course.blocks():
        yield motion, *follower.take(motion, ends), ends


def blocks_with(joints: Joints, motion: Motion) -> Iterator[Samples]:
    """Yield the blocks of a motion with its joints."""
    for (block, ends), (at, _) in zip(blocks_of(motion), blocks_of(joints), strict=True):
        yield block, at.q_rad, at.qd_rad_s, ends
