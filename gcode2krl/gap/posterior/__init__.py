"""The statistical model of a link, and its fit.

**Model.** A link has measured values y (v,), those of all its runs and components, one after the other:

    y = f(θ) + N·b + e,    e ~ N(0, L·Lᵀ),    b ~ N(0, I) within |b_i| <= sqrt(3)

- θ (p,): the free numbers of the effects that are in the model (`least_squares.Numbers`), f their simulation
  (`compare.trace.Trace.sample`), never a curve fit. Each number stays in its plausible range.
- N (v, m), b (m,): normal mismatch (`noise.nuisance`). A column of N is what one deviation does to the
  signals, to first order, times the standard deviation of a uniform draw within its bound; so b has unit
  variance, and its bound is sqrt(3) whatever the unit. b is shared by all runs for what belongs to the
  machine, and each run's own for clocks, frames and zeros.
  Mismatch is counted once (`likelihood`): a column that has the form of an effect is projected out of N
  while that effect is in the model, of runs' own columns their mean, of shared columns that have the form
  only together (the same lag of all servos is a clock) that sum. θ is then the whole deviation, and that is
  compared with the bound.
- e: noise, of each component by itself, the sum of a short and a slow part (`noise.short`):

      e_t = u_t + Σ_i v_i,t,    u_t = Σ_i a_i·u_{t-1-i} + s·w_t of order 3,    v_i,t = φ_i·v_i,t-1 + noise

  with w white. v are Ornstein-Uhlenbeck processes (Uhlenbeck & Ornstein 1930) that forget within 0.1 to 3 s,
  none, one or two: two for what a single one does not do, 1/f noise say. L⁻¹ is the Kalman filter of the sum,
  whose innovations over their deviations are white; it starts at each gap of the data in the
  stationary state and is exact from the first row on: L is the Cholesky factor of the covariance.

**Where the noise is learnt** (`noise.source`). Rows of impulses, of an instrument's bursts and outliers are
left out before (`compare.events`), hum of the mains is taken off. What nothing explains and is far from its
level for a moment is bridged, and of all runs together only windows of 20 rows count whose whitened power is
about that of the median window (`noise.short.calm_rows`): mean squares would make noise of one spike, and a
median alone would take heavy tails for less than they are.

- Short part: of each run what effects, mismatch and half-second means leave, less its tones, by
  least squares on three lags; the slow part's share of the lags is taken off first. What this takes of the
  noise itself is found by doing the same to drawn noise (Efron's bootstrap bias).
- Slow part (`noise.slow`): means over 0.05 s of the whole residual, beside a constant and a
  trend of each run and mismatch. Signatures, steps, tones, and functions of the inputs that families are made
  of  explain what they explain better than slow noise would; the rest is slow noise, its
  variance by restricted likelihood, which allows for the numbers fitted (Patterson & Thompson 1971).
- Repeats of one program: of both parts only what differs between the runs is noise.
- `run.toml` states short noise, as data sheets do: u has 0.9 to 1.4 times as much, and v is at most twice u.
  What wanders more slowly, each run in its own way, is told from a gap by `judgement`.

What a slow part can hide: an effect that is no signature, no smooth function, no tone and no step, and as
irregular as slow noise, is taken for it, up to twice the short noise in runs of different programs and up to
what repeats differ by.

**Likelihood** (`likelihood.Likelihood`). With r = L⁻¹·(y - f(θ)) and whitened columns N for short,

    chi2(θ) = min over |b_i| <= sqrt(3) of |r - N·b|² + |b|²

The marginal residual is the vector (r - N·b, b), whose squared length is chi2. While no b_i is at its bound,
chi2 = rᵀ·(I + N·Nᵀ)⁻¹·r: the same as generalised least squares with the covariance L·Lᵀ + N·Nᵀ of the raw
data, nuisance integrated out. b at a bound is held there, and what is beyond is a gap.

**Refit** (`likelihood`, `least_squares`). θ of least chi2 by Gauss-Newton; J = ∂(marginal residual)/∂θ by
differences of the simulation, H = Jᵀ·J the information, all numbers in units of their typical size. Numbers
of a prior have standard deviation `prior_sizes`; the cost of numbers is log det(I + prior_sizes²·H),
Laplace's approximation of the evidence (MacKay 1992). Numbers that the data do not give are held
(`selection`) and are no part of θ.

**Fast view** (`gram.Gram`). To first order r(θ + δ, c) = r - T·δ - S·c - N·b, T the tangents of the effects
in the model and S the signatures of a candidate, both whitened. Inner products under the inverse covariance
are

    <a, b> = aᵀ·(I + N·Nᵀ)⁻¹·b = aᵀ·b - aᵀ·N·(NᵀN + I)⁻¹·Nᵀ·b        (Woodbury)

so one Gram matrix of [r, T, S, N] holds every candidate's

- gain: the likelihood ratio 2·log Λ = chi2 without S - chi2 with the best c, b refitted within its bounds;
- observable share: <S, S> / SᵀS, the power of a signature that nuisance leaves;
- inflation: see below.

**Errors of a set-up** (`selection`): wrong zeros, base and tool, of which every arm has several, so that all
their sets S are as probable beforehand. With w ~ N(0, a²·I) in typical sizes, a the same for all, and H the
information on accepted effects and S, the fast view gives the evidence of each set and width,

    -2·log p(r | S, a) = chi2/inflation + |w|²/a² + log det(I + A·H·A) + number_cost·numbers

with A the widths on its diagonal (MacKay 1992 learns a the same way). The best S is reached by one error more
or less, from all of them and from none. It takes the place of what was accepted one by one where it has
`declared_nats` more. A cause is told from the others by the best set with it over the best without it; where
that is less, the declared set of the cause holds what only the second has.

**Clusters** (`gram`). No model is exact, so what is left of r is neither white nor independent. Rows of one
stretch of time (one second, all components) are a cluster g with the score u_g = Σ_{i in g} J_i·r_i. The
sandwich H⁻¹·(Σ_g u_g·u_gᵀ)·H⁻¹ (White 1980) is the covariance of θ without the assumption of independent
rows; trace(H⁻¹·Σ_g u_g·u_gᵀ)/p, never below 1, is the inflation of a gain: 2·log Λ over it is compared with
chi2 of p degrees. Rows are whitened first, the slow part too: stretches of one second must be longer than the
memory of what the models are off by, not than that of e, and many more than p.

**Assumptions and their range.** Mismatch is linear in b over its bounds (clocks are set first where it is
not); effects are linear over a fiftieth of their typical size (differences) and, for the fast view, over
their whole size: a large or bent effect is judged after its refit. Noise is stationary within a run.
"""
