"""All solutions of an RRR group's friction equations by one polynomial of degree 8.

All three reactions are one vector X, shifted. With X = rho expi(th) each of two equations is a
quadratic in rho; their resultant is a real trigonometric polynomial of degree 4 in th, whose
coefficients follow from 16 samples. Its roots on the unit circle are candidates that Newton's
method on t = k g corrects. Nothing of this is in the package, which follows paths instead.

Source: derived from Baranov's degree 16 of the RRR group with friction; here 8 are enough as z_C =
|X| has one sign in both equations.
"""

import numpy as np

from tests.independent.dyads import distinct

NEAR = 0.1  # of log|w|: roots cluster for small friction
SAMPLES = 16


def solutions(k, f, R):
    """Friction (s, 3) of pairs B, C, D with factors k, loads f, influences R."""
    scale = np.abs(f).max()
    f = f / scale
    p, r = R[1, 0], R[1, 2]
    T = np.linalg.inv(np.array([[p.real, r.real], [p.imag, r.imag]]))
    inner = T @ np.array([f[1].real, f[1].imag])
    G = np.array([f[0] - f[1], -(f[1] + f[2])])
    kk = np.array([k[0], k[2]]) ** 2
    s = np.array([k[1], -k[1]])  # of |X| in k_B |X + G_B| - k_C |X|, and in k_D ... + k_C |X|

    def quadratics(th):
        u = np.exp(1j * th)
        along = T @ np.array([u.real, u.imag]) + s[:, None]
        dot = G.real[:, None] * u.real + G.imag[:, None] * u.imag
        A = along**2 - kk[:, None]
        B = 2.0 * (-inner[:, None] * along - kk[:, None] * dot)
        C = (inner**2 - kk * np.abs(G) ** 2)[:, None] + 0.0 * A
        return A, B, C

    th = 2.0 * np.pi * np.arange(SAMPLES) / SAMPLES
    A, B, C = quadratics(th)
    res = (A[0] * C[1] - A[1] * C[0]) ** 2
    res -= (A[0] * B[1] - A[1] * B[0]) * (B[0] * C[1] - B[1] * C[0])
    c = np.fft.fft(res) / SAMPLES
    roots = np.roots(np.concatenate([c[4::-1], c[-1:-5:-1]]))
    angles = np.angle(roots[np.abs(np.log(np.abs(roots))) < NEAR])
    A, B, C = quadratics(angles)
    with np.errstate(all="ignore"):
        sizes = [-(A[0] * C[1] - A[1] * C[0]) / (A[0] * B[1] - A[1] * B[0])]
        for a, b, c in zip(A, B, C, strict=True):
            root = np.sqrt(np.maximum(b * b - 4.0 * a * c, 0.0))
            sizes += [(-b + root) / (2.0 * a), (-b - root) / (2.0 * a)]
    X = np.array([rho * np.exp(1j * angles) for rho in sizes]).ravel()
    X = X[np.isfinite(X)]
    t = np.stack([k[0] * np.abs(X + G[0]), k[1] * np.abs(X), k[2] * np.abs(X + G[1])], axis=1)
    return distinct(corrected(t, k, f, R) / k) * k * scale


def corrected(t, k, f, R):
    """Candidates after Newton's method, as far as they are solutions."""
    with np.errstate(all="ignore"):
        for _ in range(50):
            F = f + t @ R.T
            size = np.abs(F)
            slope = ((F / size).conj()[:, :, None] * R).real
            J = np.eye(3) - k[:, None] * slope
            J[~np.isfinite(J).all(axis=(1, 2)) | (np.linalg.det(J) == 0.0)] = np.eye(3)
            t = t - np.linalg.solve(J, (t - k * size)[..., None])[..., 0]
        size = np.abs(f + t @ R.T)
        good = np.abs(t / k - size).max(axis=1) <= 1e-9 * size.max(axis=1)
    return t[good]
