"""Tolerances that follow from rounding, said once; all of them are relative.

A formula of n operations on terms of size one is off by some n EPS at most, and by as much more
as its conditioning says; a double root by the root of that. What is tuned to anything else than
rounding stands where it is used.
"""

from __future__ import annotations

import math

from blockmech.ground.plane import EPS

ROUNDING = 4096 * EPS  # 9e-13, of formulas that are well conditioned
ROUNDED = math.sqrt(ROUNDING / EPS)  # 64 [ulps], of sums of roundings of either sign
EQUAL = 1024 * ROUNDING  # 9e-10, with a conditioning of a thousand: roots, slopes, eigenvalues
DOUBLE_ROOT = 1e-7  # rounding moves a double root by the root of rounding: 1.5e-8, and some
BLUR = 10 * DOUBLE_ROOT  # of places, cosines and margins where half of all digits are lost
DOUBLINGS = 1 + math.ceil(math.log2(-math.log10(EPS)))  # 5, of Newton's method, from one digit
HALVINGS = math.ceil(-math.log2(math.sqrt(EPS)))  # 26, from one down to what a double root leaves
