"""Families: on what a gap depends, before what it is called.

**Hypotheses.** A family is a *place* (the tip, a joint, the force) and an *input* of the link (time in the
run, own torque, force by place, …: `effects.dependence.Dependence`). It says that what is left of a link is a
function of that input at that place, of whatever form:

    r = B·w + T·δ + N·b + e,    w ~ N(0, a²·Λ),    δ ~ N(0, prior_sizes²·I),    b ~ N(0, I) within its bounds

with r the whitened residual, T the tangents of the effects that are in the model, N nuisance (all as in
`gcode2krl.gap.fit`), and B the columns of the functions: hats over the range of the input, whose covariance Λ
has a length scale; low polynomials of place; play operators of several widths; harmonics. Rows are whitened
first and then averaged over blocks of time (`rows`), which keeps the power of all that is slower.

**Evidence** (`evidence`). With <., .> the inner products under the inverse covariance of T·δ + N·b + e,
G = <B, B> and g = <B, r>,

    log p(r | a, Λ) - log p(r | nothing) = -½·log det(I + a²·Λ·G) + ½·gᵀ·(G + (a²·Λ)⁻¹)⁻¹·g

the mean of whose exponential over a grid of amplitudes a and length scales is the evidence of the family.
Nuisance at its bounds is held there: the second term is then half the fall of chi2 with bounded b.

**Steps and tones** (`steps`, `tone_search`). Their moment or frequency is a number that the data must find:
the mean of the evidences over all positions pays for the search.

**Null** (`study`). Scores u_g = Σ_{i in g} B_i·r_i over stretches of time g (one second). If nothing
admissible explains the rest, their signs are arbitrary; the largest evidence over all families with signs
drawn at random is what the largest one has to exceed; for a gap by the Gumbel distribution of the flips.
Few strong stretches have few signs: there the evidence alone must be beyond what models of sound machines
are off by. What happens once, in a few rows, has a null of its own (`gcode2krl.gap.beside.events`).
"""
