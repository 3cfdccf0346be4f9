"""Effects that are in no library: the right answer is that something is unexplained, where, and on what it
depends. One file each, with its physics and where that is known from.
"""

from tests.plant.effects.open import (
    bearing_wobble,
    belt_resonance,
    brake_drag,
    cable_snag,
    chatter,
    chip_packing,
    cogging,
    coolant_jet,
    counterbalance,
    crane_passes,
    cross_talk,
    encoder_drop_out,
    floor_sways,
    hard_spot,
    hose_swings,
    interpolation_jitter,
    load_inertia,
    oil_friction,
    reflector_incidence,
    reflector_reseats,
    sensor_saturates,
    spindle_bow,
    stress_release,
    thermal_gusts,
    tool_chips,
    tool_creeps,
)
