"""The ``[online]`` section of a cell: how the compensator, its limits and the link to the robot are set."""

import math
from ipaddress import AddressValueError, IPv4Address
from typing import Annotated, Literal, Self

from pydantic import Field, field_validator, model_validator

from gcode2krl.cell.sections import Finite, NotNegative, Positive, Section, SignalNumber, SixFloats

AddressText = Annotated[str, Field(max_length=40)]
"""Longer than any address, so that a finding that quotes it stays one line."""
PortNumber = Annotated[int, Field(strict=True, ge=1, le=65535)]
CYCLES_S = (0.004, 0.012)
_BROADCAST = IPv4Address("255.255.255.255")
LEAD_SHARE_OF_BLEND = 0.2
"""Fraction of the blend time that is added to the lead; see `Online.pilot_lead_s`."""


class Gains(Section):
    """A PID controller for each direction or axis; 1, 0, 0 passes the correction on unchanged."""

    p: Finite = 1.0
    i_1_s: NotNegative = 0.0
    d_s: NotNegative = 0.0


class RobotLink(Section):
    """Where the telegrams go, and what ends a session."""

    address: AddressText = "127.0.0.1"
    """Where the server listens, and where the controller looks for it; loopback unless stated."""
    robot_address: AddressText | None = None
    """The controller's address: only its datagrams are read. None: the first that sends a telegram is the
    controller; not allowed where the server listens on every network (``0.0.0.0``)."""
    port: PortNumber = 49152
    sensor_type: Annotated[str, Field(pattern=r"^[A-Za-z0-9_]{1,32}$")] = "ImFree"
    """``SENTYPE`` of the controller's file, sent in every answer."""
    timeout_cycles: Annotated[int, Field(strict=True, ge=1, le=5)] = 5
    """``Timeout`` of the controller's ETHERNET object: cycles without answer until RSI stops."""
    lost_cycles: Annotated[int, Field(strict=True, ge=1, le=100)] = 5
    """Telegrams missing in a row after which the correction is held for the rest of the session; the
    controller gives up after as many."""
    silence_s: Positive = 1.0
    """After this time without a telegram the session ends and no telegram is answered any more."""
    decimals: Annotated[int, Field(strict=True, ge=3, le=9)] = 4
    """``Precision`` of the ETHERNET object: decimals of what the robot sends; KUKA's default is 1."""
    t1_output: SignalNumber = 993
    """``$OUT`` that is on in T1 (``SIGNAL $T1`` in ``STEU/Mada/$machine.dat``); 993 in a public archive of
    KSS 8.3: to be confirmed on the controller."""
    ready_output: SignalNumber = 1020
    """``$OUT`` that RSI keeps on while corrections are made, and that falls with the first answer missing;
    the program waits for it and stops without it. The number is our choice: the output must be free."""
    retract_mm: Positive = 50.0
    """Length of the retract along the tool axis, out of the part, where the link is lost in a cut."""

    @field_validator("address", "robot_address")
    @classmethod
    def _is_an_address(cls, text: str | None) -> str | None:
        if text is None:
            return None
        try:
            address = IPv4Address(text)
        except AddressValueError:
            raise ValueError(f"found {text!r}, allowed: an IPv4 address such as 192.168.1.10") from None
        if address.is_multicast or address == _BROADCAST:
            raise ValueError(f"found {text!r}, allowed: the address of one computer")
        return str(address)

    @model_validator(mode="after")
    def _one_robot(self) -> Self:
        """A server that listens on every network must know the controller's address."""
        if self.robot_address is None:
            if IPv4Address(self.address).is_unspecified:
                raise ValueError(
                    f"address {self.address} listens on every network: give robot_address, the controller's "
                    "address, or the address that this computer has in the robot's network"
                )
            return self
        robot = IPv4Address(self.robot_address)
        if robot.is_unspecified:
            raise ValueError(
                f"robot_address: found {self.robot_address!r}, allowed: the controller's address"
            )
        if IPv4Address(self.address).is_loopback and not robot.is_loopback:
            raise ValueError(
                f"the controller at {self.robot_address} cannot reach {self.address}: give address, that of "
                "this computer in the robot's network"
            )
        return self

    @model_validator(mode="after")
    def _own_outputs(self) -> Self:
        if self.t1_output == self.ready_output:
            raise ValueError(f"t1_output and ready_output are both {self.ready_output}")
        return self


class Probe(Section):
    """How the server finds out whether the robot takes corrections as absolute."""

    amplitude_mm: Annotated[float, Field(strict=True, gt=0, le=0.2)] = 0.1
    """A correction along the tool axis, away from the part, while the robot stands in air."""
    rest_cycles: Annotated[int, Field(strict=True, ge=5)] = 25
    """The robot must have stood still for this long."""
    rest_mm: Positive = 0.02
    """The robot stands still if RIst moves by no more: the resolution of two decimals and its rounding."""
    most_cycles: Annotated[int, Field(strict=True, ge=2, le=50)] = 25
    """The probe is on for at most this long; it ends as soon as the robot is seen to move."""
    settle_cycles: Annotated[int, Field(strict=True, ge=5)] = 25
    """After this time the robot must be back where it was."""


class Online(Section):
    """The compensator of Haehn & Weigold 2020, section 2, and its limits."""

    cycle_s: Positive = 0.004
    """0.004 (#IPO_FAST) or 0.012 (#IPO); the paper's is 4 ms (section 2.2)."""
    mode: Literal["cartesian", "axis"] = "cartesian"
    lowpass_hz: Positive = 4.0
    average_s: NotNegative = 0.040
    """The paper names the filters, not their times; with these a force step shows to 90 % in the robot's
    reaction after 140 ms, within its 100-150 ms (section 2.3)."""
    threshold_N: Positive = 150.0
    blend_s: Positive = 0.080
    """Section 2.3."""
    lead_s: NotNegative | None = None
    """None: from the robot's delay, see `pilot_lead_s`."""
    robot_delay_s: NotNegative | None = None
    """From a correction sent to the robot's movement, as measured on this robot."""
    gains: Gains = Gains.model_construct()
    axis_gains: Annotated[tuple[Gains, ...], Field(min_length=6, max_length=6)] = (
        Gains.model_construct(),
    ) * 6
    most_mm: Annotated[float, Field(strict=True, gt=0, le=10)] = 2.5
    """Largest correction, of the sum; also ``POSCORR`` and ``POSCORRMON``. 1.4 mm is the paper's largest
    deviation."""
    rate_mm_s: Positive = 50.0
    """Largest rate; behind the low-pass of 4 Hz a correction of 1.4 mm falls at 35 mm/s at first."""
    step_mm: Positive = 0.25
    """Largest change from one telegram to the next."""
    axis_most_deg: SixFloats = (0.3, 0.3, 0.3, 2.0, 2.0, 2.0)
    axis_rate_deg_s: SixFloats = (6.0, 6.0, 6.0, 40.0, 40.0, 40.0)
    limit_margin_deg: NotNegative = 1.0
    """No correction may bring a joint nearer to its limit than this."""
    most_force_N: Positive = 2000.0
    """A larger force cannot come from cutting; the correction is held."""
    sensor_hold_s: NotNegative = 0.020
    """The sensor may send nothing, or NaN, for this long before the correction is held."""
    calibration: str | None = None
    """File of `identify sensor`, relative to the cell file; None: the sensor's values are used as the process
    force."""
    probe: Probe = Probe.model_construct()
    link: RobotLink = RobotLink.model_construct()

    @field_validator("cycle_s")
    @classmethod
    def _is_a_cycle_of_rsi(cls, seconds: float) -> float:
        if seconds not in CYCLES_S:
            raise ValueError(f"found {seconds:g}, allowed: 0.004 or 0.012")
        return seconds

    @field_validator("axis_most_deg", "axis_rate_deg_s")
    @classmethod
    def _is_above_zero(cls, values: tuple[float, ...]) -> tuple[float, ...]:
        if min(values) <= 0.0:
            raise ValueError(f"found {min(values):g}, allowed: above 0")
        return values

    @model_validator(mode="after")
    def _probe_is_one_step(self) -> Self:
        """The probe must be one step: it is taken back at once if the robot adds corrections up."""
        step_mm = min(self.step_mm, self.rate_mm_s * self.cycle_s)
        if self.probe.amplitude_mm > step_mm:
            raise ValueError(
                f"probe.amplitude_mm {self.probe.amplitude_mm:g} is more than one step of the correction, "
                f"{step_mm:g} mm (the smaller of step_mm and rate_mm_s * cycle_s): lower it, or raise them"
            )
        return self

    @property
    def pilot_lead_s(self) -> float:
        """Return how far ahead the pilot force is taken.

        The robot's delay and a fifth of the blend time, where the delay was measured, else the paper's 40 ms
        (section 2.3): half-way through the linear blend the estimate has half the weight, and by then the
        filtered measurement has begun to follow.
        """
        if self.lead_s is not None:
            return self.lead_s
        if self.robot_delay_s is not None:
            return self.robot_delay_s + LEAD_SHARE_OF_BLEND * self.blend_s
        return 0.040

    @property
    def memory_s(self) -> float:
        """Return how long an event has an effect: lead, blend, four times the filters' delay, robot's delay.

        Four times, because a first-order low-pass has decayed by 98 % by then.
        """
        return self.pilot_lead_s + self.blend_s + 4.0 * self.filter_s + (self.robot_delay_s or 0.024)

    @property
    def filter_s(self) -> float:
        """Return the mean delay of low-pass and moving average."""
        return 1.0 / (2.0 * math.pi * self.lowpass_hz) + 0.5 * self.average_s
