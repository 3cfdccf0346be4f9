"""Damaged, made-up and sound telegrams: the parser, the session behind it, the answer.

    python benchmarks/fuzz_telegrams.py --count 1000000 --seed 1

What is taken for a telegram goes through a session of its own state; each answer is checked as in
`online_faults`: finite, and at most one step from the one before.
"""

import re
import sys
from pathlib import Path

import numpy as np
from fuzz_common import Try, main_of, mutated

NUMBERS = (
    b"nan",
    b"inf",
    b"1e99",
    b"-1e99",
    b"1e999",
    b"0x1",
    b"1,5",
    b"",
    b" 1 ",
    b"--1",
    b"1e-99",
    b"9" * 15,
    b"9" * 16,
    b"1_0",
    b"+.5",
    b"-0.0",
    b"\xd9\xa1",
)
TRICKS = (
    b"",
    b"<Rob>" + b" " * 8000 + b"</Rob>",
    b"<Rob>" + b"<A/>" * 1500 + b"</Rob>",
    b"<Rob>" + b"</Rob>" * 1000,
    b"<Rob>" + b'<A B="1"' + b" C" * 3000 + b"</Rob>",
    b'<!DOCTYPE a [<!ENTITY b "cc">]><Rob>&b;</Rob>',
    b"<Rob>" + b"<A>" * 2000 + b"</Rob>",
    b"<Rob " * 1500,
    b" " * 8192,
    b"<Rob>" + b"<A \t" * 2000 + b"</Rob>",
    b"\xff\xfe<\x00R\x00",
    b'<Rob Type="KUKA">' * 400,
    b"<Rob>" + b"\n" * 4000 + b"<A>" + b" " * 4000,
    b"x" * 70_000,
    b"<Rob>" + b'<AAAAAAAA X="1" ' + b"Y =\t" * 1900 + b"</Rob>",
    b'<Sen Type="ImFree"><IPOC>1</IPOC></Sen>',
)


def prepare(place: Path) -> Try:
    """Start sessions; return the function that tries a case."""
    from gcode2krl import load_cell
    from gcode2krl.cell.sections.online import Online, Probe
    from gcode2krl.errors import input_error
    from gcode2krl.online.compensator import build_compensator
    from gcode2krl.online.server import warm_up
    from gcode2krl.online.session import Phase, begin, exchange
    from gcode2krl.online.telegram import MalformedError, answer_text, parse

    probe = Probe(rest_cycles=5, settle_cycles=5)
    devices = [
        build_compensator(load_cell(), Online(mode=mode, probe=probe), load_frame="sensor")
        for mode in ("cartesian", "axis")
    ]
    for device in devices:
        warm_up(device)
    state = [begin(device) for device in devices]
    ipoc = [1000, 1000]

    def attempt(rng: np.random.Generator, _: Path) -> str:
        which = int(rng.integers(len(devices)))
        device, session = devices[which], state[which]
        ipoc[which] += 4
        data = damaged(rng, good(rng, ipoc[which], session.sent))
        try:
            telegram = parse(data)
        except MalformedError as error:
            words = str(error)
            assert len(words) < 200, "more than a line"
            assert words.isprintable(), "more than a line"
            raise input_error("malformed", words) from None
        before = session.sent
        session, answer = exchange(session, telegram, telegram.load, device)
        if answer is not None:
            step = (answer.correction - before) / device.bounds.step
            size = np.linalg.norm(step) if device.bounds.is_vector else np.abs(step).max()
            assert size <= 1.0 + 1e-9, f"a step of {size}"
            text = answer_text(answer, device.settings)
            assert f"<IPOC>{telegram.ipoc}</IPOC>".encode() in text
        over = session.phase in (Phase.CLOSED, Phase.ZERO, Phase.HELD) and rng.random() < 0.1
        state[which] = begin(device) if over else session
        ipoc[which] = 1000 if over else max(ipoc[which], min(telegram.ipoc, 10**17))
        return "telegram"

    return attempt


def good(rng: np.random.Generator, ipoc: int, sent: np.ndarray) -> bytes:  # type: ignore[type-arg]
    """Return a sound telegram of a robot that follows its corrections."""
    shift = sent if len(sent) == 3 else np.array([0.0, 0.0, 0.1 * bool(sent.any())])
    x, y, z = shift + np.array([50.0, 0.0, 40.0])
    return (
        f'<Rob Type="KUKA"><RIst X="{x:.4f}" Y="{y:.4f}" Z="{z:.4f}" A="0.0" B="0.0" C="0.0"/>'
        '<RSol X="50.0000" Y="0.0000" Z="40.0000" A="0.0" B="0.0" C="0.0"/>'
        '<AIPos A1="0.2" A2="-80.5" A3="95.1" A4="0.0" A5="45.3" A6="10.0"/>'
        '<ASPos A1="0.2" A2="-80.5" A3="95.1" A4="0.0" A5="45.3" A6="10.0"/><Delay D="0"/>'
        f'<Force X="{rng.normal(0.0, 200.0):.2f}" Y="10.0" Z="-5.0" MX="1.0" MY="2.0" MZ="3.0"/>'
        f"<SenPInt1>3</SenPInt1><OvPro>100</OvPro><IPOC>{ipoc}</IPOC></Rob>"
    ).encode("ascii")


def damaged(rng: np.random.Generator, data: bytes) -> bytes:
    """Return a telegram as it may come."""
    kind = int(rng.integers(10))
    if kind < 3:
        return data
    if kind < 6:
        return mutated(rng, data, data)
    if kind == 6:
        return rng.bytes(int(rng.integers(0, 300)))
    if kind == 7:
        number = NUMBERS[int(rng.integers(len(NUMBERS)))]
        fields = list(re.finditer(rb"[-\d.]+(?=[\"<])", data))
        at = fields[int(rng.integers(len(fields)))]
        return data[: at.start()] + number + data[at.end() :]
    if kind == 8:
        return TRICKS[int(rng.integers(len(TRICKS)))]
    parts = re.split(rb"(?=<)", data)
    rng.shuffle(parts)
    return b"".join(parts)


main = main_of("telegrams", prepare, __doc__, 1_000_000)

if __name__ == "__main__":
    sys.exit(main())
