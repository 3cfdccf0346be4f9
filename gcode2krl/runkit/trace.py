"""How the controller's own recorder is set up for the run in air, and where the recording belongs."""

from gcode2krl.prediction import Prediction

_CYCLE_MS = 12
_TEXT = """Trace of {name} on the controller (KSS 8, oscilloscope)

What is recorded is compared with the prediction beside this file. Names of channels and variables are those
that public readers of KRC traces use; no controller has confirmed them. Differs yours, keep the channels.

1  Channels, all of the interpolator (KRCIpo), every {cycle} ms:
     X_CmdIpo Y_CmdIpo Z_CmdIpo A_CmdIpo B_CmdIpo C_CmdIpo
     AxisPos_CmdIpo1 to AxisPos_CmdIpo6
     AxisPos_Act1 to AxisPos_Act6
   and of each drive (NextGenDrive#1 to #6), where they can be had:
     Sollposition, Istposition, Iststrom, Istmoment
2  Length: {seconds} s. The motion takes {motion:.1f} s at 100 %, and halts come on top.
   Where the recorder holds less, record stretches one after the other, or log by RSI (docs/runs.md).
3  Trigger: by hand, or by these statements before the first PTP of a copy of {name}:
     $TRACE.NAME[]="{name}"
     $TRACE.CONFIG[]="GCODE2KRL.xml"     ; the configuration saved on the smartPAD under that name
     $TRACE.MODE=#T_START                ; $TRACE.STATE is #T_WAIT or #TRIGGERED when it runs
   and behind the last motion:
     $TRACE.MODE=#T_STOP                 ; copy when $TRACE.STATE is #T_END, not while it is #T_WRITING
4  Run {name} in AUT at 100 % override: not T1, and no other override. Predictions hold at 100 % only.
5  Copy {name}_KRCIpo.dat, {name}_NextGenDrive#1.dat and so on, each with its .r64, from
   C:\\KRC\\ROBOTER\\TRACE into {run}.
6  gcode2krl diagnose {prediction} {run}
"""
_RUN = """# The run in air at 100 % override. Put the trace, or controller.csv, beside this file.
mode = "AUT"
override_percent = 100
prediction = "../prediction"
"""
_MARGIN_S = 30.0


def set_up_text(name: str, air: Prediction) -> str:
    """Return what to set on the controller to record the variant in air."""
    motion_s = float(air.motion.time_s[-1]) if air.motion is not None else 0.0
    seconds = int(motion_s + _MARGIN_S) + 1
    return _TEXT.format(
        name=name, cycle=_CYCLE_MS, seconds=seconds, motion=motion_s, run="run_air/", prediction="prediction/"
    )


def run_text() -> str:
    """Return the head of the run that the trace becomes."""
    return _RUN
