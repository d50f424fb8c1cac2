"""Newmark's block in closed form: permanent displacement over A T² of a cycle of each wave.

r = Üy/A is from 0 to 1.  The block slides while its velocity v is positive: from w = r on at the
rate w − r, in units of A, to the root of v; w is the wave and s = t/T.  It always stops within the
cycle, as ∫ w over the cycle is 0 and v would end at −r (1 − s₁) − ∫ w up to the onset s₁.
"""

from mpmath import mp, mpf

mp.dps = 30


def rectangle(r: mpf) -> mpf:
    """A rectangular pulse of duration T: (V²/2Üy)(1 − Üy/A) with V = A T (Newmark 1965)."""
    return (1 - r) / (2 * r)


def square(r: mpf) -> mpf:
    """Half a cycle at the rate 1 − r, then at −1 − r to the stop."""
    return (1 - r) / (4 * (1 + r))


def sine(r: mpf) -> mpf:
    """From φ₁ = asin r to the root φ₂ of v = cos φ₁ − cos φ − r (φ − φ₁), behind the next w = r."""
    first = mp.asin(r)

    def velocity(phase: mpf) -> mpf:
        return mp.cos(first) - mp.cos(phase) - r * (phase - first)

    # from the peak on by π/2 − φ₁ to that w = r, and by two to three times as much to the root
    quarter = mp.acos(r)
    bracket = (mp.pi / 2 + quarter, mp.pi / 2 + 3 * quarter)
    last = mp.findroot(velocity, bracket, solver="anderson", maxsteps=200, verify=False)
    slides = (mp.cos(first) + r * first) * (last - first) - (mp.sin(last) - mp.sin(first))
    return (slides - r * (last**2 - first**2) / 2) / (4 * mp.pi**2)


def triangle(r: mpf) -> mpf:
    """(3 + 2√2)/48 (1 − r)³ if the block stops on the falling line, r ≥ 3 − 2√2; else behind it."""
    if r >= 3 - 2 * mp.sqrt(2):
        return (3 + 2 * mp.sqrt(2)) / 48 * (1 - r) ** 3
    # v and u where the wave is −1, s = 3/4; then w = 4 y − 1 up to the stop, y later
    velocity = (1 - r) ** 2 / 8 + (1 - r) / 2 - mpf(1) / 2
    slid = (1 - r) ** 3 / 96 + (1 - r) ** 2 / 16 + (1 - r) / 8 - mpf(1) / 12
    y = (1 + r - mp.sqrt((1 + r) ** 2 - 8 * velocity)) / 4
    return slid + velocity * y - (1 + r) * y**2 / 2 + 2 * y**3 / 3
