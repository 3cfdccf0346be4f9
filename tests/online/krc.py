"""A controller for tests: sends telegrams as KUKA's does, takes corrections as absolute or adds them up.

Written from the protocol, not from the server: it builds and reads XML with the standard library.
"""

import xml.etree.ElementTree as ET
from collections import deque

import numpy as np

from gcode2krl import robot
from gcode2krl.units import DEG_PER_RAD


class Krc:
    """One robot standing or moving in ``$BASE``, the correction applied after some cycles and a lag."""

    def __init__(
        self,
        cell,
        *,
        cycle_ms=4,
        relative=False,
        dead_cycles=1,
        lag_s=0.0,
        decimals=4,
        ipoc=123456,
        start_mm=(50.0, 0.0, 40.0),
        stands_s=1.0,
        speed_mm_s=25.0,
        axis=False,
        ignores=False,
    ):
        self.cell, self.cycle_ms, self.relative, self.decimals = cell, cycle_ms, relative, decimals
        self.lag_s, self.axis, self.ignores = lag_s, axis, ignores
        self.ipoc = ipoc
        self.start_mm, self.stands_s, self.speed_mm_s = np.array(start_mm), stands_s, speed_mm_s
        width = 6 if axis else 3
        self.waiting = deque([np.zeros(width)] * dead_cycles)
        self.asked = np.zeros(width)
        self.applied = np.zeros(width)
        self.late = 0
        self.time_s = 0.0
        self.told = {}
        self.load = None
        self.answered = 0
        self.ready = False
        level = np.array([[0.0, 0.0, 0.0, 1.0]])
        self.q_at_mm, self.q_rad = self.start_mm, robot.inverse(self.start_mm[None], level, cell, 1)[0, 2]

    def program_mm(self):
        """Where the program is."""
        moved = self.speed_mm_s * max(self.time_s - self.stands_s, 0.0)
        return self.start_mm + np.array([moved, 0.0, 0.0])

    def program_q(self):
        """Joints of the program; of a Cartesian robot to the nearest few millimetres, which is quicker."""
        here = self.program_mm()
        if np.abs(here - self.q_at_mm).max() > (0.0 if self.axis else 3.0):
            level = np.array([[0.0, 0.0, 0.0, 1.0]])
            self.q_at_mm, self.q_rad = here, robot.inverse(here[None], level, self.cell, 1)[0, 2]
        return self.q_rad

    def tip_mm(self):
        """Where the tip is."""
        if self.axis:
            return robot.forward((self.program_q() + self.applied)[None], self.cell, 1)[0][0]
        return self.program_mm() + self.applied

    def telegram(self):
        """Return what is sent in this cycle."""
        root = ET.Element("Rob", Type="KUKA")
        q = self.program_q()
        poses = (
            ("RIst", "XYZABC", (*self.tip_mm(), 0.0, 0.0, 0.0)),
            ("RSol", "XYZABC", (*self.program_mm(), 0.0, 0.0, 0.0)),
            ("AIPos", ("A1", "A2", "A3", "A4", "A5", "A6"), q * DEG_PER_RAD),
            ("ASPos", ("A1", "A2", "A3", "A4", "A5", "A6"), q * DEG_PER_RAD),
        )
        for tag, names, values in poses:
            element = ET.SubElement(root, tag)
            for name, value in zip(names, values, strict=True):
                element.set(name, f"{value:.{self.decimals}f}")
        ET.SubElement(root, "Delay", D=str(self.late))
        for tag, value in self.told.items():
            ET.SubElement(root, tag).text = str(value)
        if self.load is not None:
            names = ("X", "Y", "Z", "MX", "MY", "MZ")
            words = {n: f"{v:.3f}" for n, v in zip(names, self.load, strict=True)}
            ET.SubElement(root, "Force", **words)
        ET.SubElement(root, "IPOC").text = str(self.ipoc)
        return ET.tostring(root)

    def take(self, answer):
        """Take an answer, None if there is none, and go on to the next cycle."""
        correction = None
        if answer is not None:
            root = ET.fromstring(answer)
            assert root.tag == "Sen"
            assert root.get("Type") == "ImFree"
            if int(root.find("IPOC").text) == self.ipoc:
                element = root.find("AKorr" if self.axis else "RKorr")
                names = [f"A{k}" for k in range(1, 7)] if self.axis else ["X", "Y", "Z"]
                correction = np.array([float(element.get(name)) for name in names])
                correction = np.radians(correction) if self.axis else correction
                self.ready = root.find("Ready").text == "1"
                self.answered += 1
        if correction is None:
            self.late += 1
            self.ready = False
        else:
            self.asked = correction  # HOLDON: the last correction is kept
        self.waiting.append(np.zeros_like(self.asked) if self.ignores else self.asked)
        now = self.waiting.popleft()
        target = self.applied + now if self.relative else now
        share = 1.0 if self.lag_s <= 0.0 else 1.0 - np.exp(-0.001 * self.cycle_ms / self.lag_s)
        self.applied = target if self.relative else self.applied + share * (target - self.applied)
        self.ipoc += self.cycle_ms
        self.time_s += 0.001 * self.cycle_ms
