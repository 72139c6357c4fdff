"""The gate of a stacked update: every match is judged by all the others.

Before an update all matches of a frame share the error of the predicted pose, so each may lie far
from its prediction and still agree with the rest; and one that slid along an edge may lie near its
prediction and disagree with all the others. Given the others, match i has the innovation and the
covariance
    nu_i|rest = B_i^-1 a_i,   S_i|rest = B_i^-1,   a = S^-1 nu,  B_i = (S^-1)_ii,
so that d2_i|rest = a_i' B_i^-1 a_i is chi-square distributed with the dimension of z_i when match i
is right. It is the test on residuals of Baarda, *A testing procedure for use in geodetic networks*,
1968, on the innovations of the whole frame.
"""

from __future__ import annotations

import numpy as np

from scene_core.arrays import Mat, Vec


def disagreements(nu: Vec, S: Mat) -> Vec:
    """d2 (k,) of each match given the k - 1 others, from all innovations nu (k, m) and their joint
    covariance S (km, km)."""
    k, m = nu.shape
    inverse = np.linalg.inv(S)
    a = (inverse @ nu.ravel()).reshape(k, m)
    own = inverse.reshape(k, m, k, m)[np.arange(k), :, np.arange(k)]
    return (a * np.linalg.solve(own, a[..., None])[..., 0]).sum(-1)


def odd_ones(nu: Vec, S: Mat, gate: float) -> list[tuple[int, float]]:
    """Matches (row, d2 given the others) that disagree with the rest, the worst first.

    nu (k, m), S (km, km). The match with the largest d2 given the others is taken out while that is
    above `gate` and at least three matches are left: two that disagree can not say who is wrong.
    """
    k, m = nu.shape
    left = np.arange(k)
    out: list[tuple[int, float]] = []
    while len(left) >= 3:
        rows = (left[:, None] * m + np.arange(m)).ravel()
        d2 = disagreements(nu[left], S[np.ix_(rows, rows)])
        worst = int(np.argmax(d2))
        if d2[worst] < gate:
            break
        out.append((int(left[worst]), float(d2[worst])))
        left = np.delete(left, worst)
    return out
