"""The links of the instruments at the tool: force and mechanics."""

from collections.abc import Iterable, Iterator, Sequence

from gcode2krl.arrays import Floats
from gcode2krl.effects import Applied, Inputs, Signals, forces
from gcode2krl.effects.mismatch import Mismatch, sigma
from gcode2krl.gap.beside.context import Context
from gcode2krl.gap.beside.instruments import component_columns, force_zero_columns, frame_columns
from gcode2krl.gap.beside.links.base import Link
from gcode2krl.gap.beside.links.joints import PathLink, ServoLink
from gcode2krl.gap.beside.links.traces import vector_trace
from gcode2krl.gap.beside.pair import Pair
from gcode2krl.gap.beside.trace import Trace
from gcode2krl.gap.beside.verdict import FittedVerdict, is_lost
from gcode2krl.gap.thresholds import THRESHOLDS


class ForceLink(Link):
    """The measured force against the predicted one."""

    name = "force"
    signal = "force"
    unit = "N"
    needs = "force.csv, and a prediction with forces"
    table = "force"

    def trace(self, pair: Pair, base: Sequence[Applied] = ()) -> Trace | None:
        """Return the force of a run with a prediction, along the axes in which it is stated."""
        table, head = pair.run.force, pair.run.head
        if table is None or pair.from_log:
            return None
        return vector_trace(
            self,
            pair,
            table,
            table.force_N,
            "force_meas_base_N",
            base=base,
            frame=head.frames.force,
            sigma=head.noise.force_N,
        )

    def simulated(self, trace: Trace, applied: Sequence[Applied]) -> Signals:
        """Return the forces and their clock: a tip need not be computed."""
        return forces(trace.inputs, applied)

    def mismatch(self, trace: Trace, mismatch: Mismatch) -> Iterator[tuple[str, Floats]]:
        """Yield the zero and the gain of the force sensor."""
        yield "force zero", force_zero_columns(trace) * sigma(mismatch.force_zero_N)
        yield "sensor gain", component_columns(trace.nominal) * sigma(mismatch.sensor_gain)

    def learn(self, context: Context, judged: FittedVerdict) -> Context:
        """Let the named causes bend the arm; where the model does not hold, let the measured force do so."""
        learned = (applied.effect.learned(applied, self.name) for applied in judged.applied)
        context = context.with_learned(applied for applied in learned if applied is not None)
        if is_lost(judged):
            base = self.base(context)
            seen, bending = (*base, *judged.applied), (*base, *context.learned)
            pairs = (pair.with_measured_load(seen, bending) for pair in context.pairs)
            context = context.with_pairs(pairs)
        return context


class MechanicsLink(Link):
    """The tip against FK(joints) + C(q)·F."""

    name = "mechanics"
    signal = "tcp"
    unit = "mm"
    of_tip = True
    needs = "tracker.csv, absolute angles and a known robot"
    table = "tracker"
    sets_clocks = True
    least_off = THRESHOLDS.beside.progress_off_mm
    least_step = THRESHOLDS.beside.progress_step_mm

    def trace(self, pair: Pair, base: Sequence[Applied] = ()) -> Trace | None:
        """Return the tip, beside the model from the measured joints."""
        run, head = pair.run, pair.run.head
        table = run.poses if pair.still else run.tracker
        if table is None or not pair.known_robot or (pair.from_log and head.angles == "relative"):
            return None
        pair = pair.with_measured_joints("q_load")
        return vector_trace(
            self,
            pair,
            table,
            table.position_mm,
            "tcp_base_mm",
            base=base,
            frame=head.frames.tracker,
            sigma=head.noise.tcp_mm,
        )

    def traces(self, pairs: Iterable[Pair], base: Sequence[Applied] = ()) -> list[Trace]:
        """Return the tips of all runs; of motions alone where some runs are of poses, whose noise differs."""
        traces = super().traces(pairs, base)
        return [trace for trace in traces if not trace.still] or traces

    def planned(self, inputs: Inputs) -> Floats:
        """Return the commanded tip (m, 3)."""
        return inputs.position_mm

    def base(self, context: Context) -> tuple[Applied, ...]:
        """Return slips and what the force has shown: both move the tip."""
        return (*context.slips, *context.learned)

    def clocks(self, context: Context) -> int:
        """Return two where the joints are on the controller's clock, which no path has set."""
        on_two = not context.has_data(PathLink.name) and context.has_data(ServoLink.name)
        return max(super().clocks(context), 2 if on_two else 1)

    def mismatch(self, trace: Trace, mismatch: Mismatch) -> Iterator[tuple[str, Floats]]:
        """Yield the frame in which the tracker states the tip."""
        yield "tracker frame", frame_columns(trace, mismatch)

    def has_time_law(self, unmeasured: frozenset[str]) -> bool:
        """Tell whether the commanded path is not measured, so that the tip shows its time law."""
        return PathLink.name in unmeasured
