"""Small linear systems in machine code: LAPACK, asked for one lane after the other.

The entries of a system are put into a room of vectors, one a number, lanes side by side: the
matrix by columns, then the right side. What is found takes the place of the right side, or of
the first entry. A matrix without an answer gives NaN; ``copy`` says 0 of entries that are finite.

The routines are those of SciPy, by the table that Cython publishes of a module (`__pyx_capi__`),
as Numba asks for them; NumPy's are the same of another build: engines agree to rounding.

Source: Anderson et al., LAPACK Users' Guide, 1999 (dgesv, dgesvd).
"""

from __future__ import annotations

import ctypes
from typing import Any

ROUTINES = ("dgesv", "dgesvd")


def text(lanes: int) -> str:
    """The functions ``solve`` and ``spread`` of a room and the number of rows."""
    return f"""
declare void @dgesv({", ".join(["ptr"] * 8)})
declare void @dgesvd({", ".join(["ptr"] * 14)})
@undefined = constant double 0x7FF8000000000000
@nothing = constant i8 78

define double @copy(ptr %to, i32 %step, ptr %from, i32 %stride, i32 %count) {{
start:
  br label %test
test:
  %i = phi i32 [ 0, %start ], [ %i.next, %one ]
  %nought = phi double [ 0.0, %start ], [ %nought.next, %one ]
  %more = icmp slt i32 %i, %count
  br i1 %more, label %one, label %done
one:
  %from.i = mul i32 %i, %stride
  %from.at = getelementptr double, ptr %from, i32 %from.i
  %x = load double, ptr %from.at
  %to.i = mul i32 %i, %step
  %to.at = getelementptr double, ptr %to, i32 %to.i
  store double %x, ptr %to.at
  %share = fmul double %x, 0.0
  %nought.next = fadd double %nought, %share
  %i.next = add i32 %i, 1
  br label %test
done:
  ret double %nought
}}
{_by_lane("solve", "%all", "%n", SOLVED, lanes)}
{_by_lane("spread", "%square", "1", SPREAD, lanes)}
"""


SOLVED = """
  %place = mul i32 %square, LANES
  call void @dgesv(ptr %size, ptr %one, ptr %a, ptr %size, ptr %pivots, ptr %x, ptr %size,
    ptr %info)
"""
SPREAD = """
  %place = mul i32 0, LANES
  %finite = fcmp oeq double %nought, 0.0
  br i1 %finite, label %known, label %lost
known:
  call void @dgesvd(ptr @nothing, ptr @nothing, ptr %size, ptr %size, ptr %a, ptr %size, ptr %s,
    ptr %a, ptr %size, ptr %a, ptr %size, ptr %work, ptr %room, ptr %info)
  %largest = load double, ptr %s
  %last = sub i32 %n, 1
  %least.at = getelementptr double, ptr %s, i32 %last
  %least = load double, ptr %least.at
  %ratio = fdiv double %least, %largest
  store double %ratio, ptr %x
"""


def _by_lane(name: str, entries: str, to_lane: str, body: str, lanes: int) -> str:
    """A function that does for each lane what a body says, from %a to %x."""
    return f"""
define void @{name}(ptr %whole, i32 %n) {{
start:
  %size = alloca i32
  store i32 %n, ptr %size
  %one = alloca i32
  store i32 1, ptr %one
  %info = alloca i32
  %pivots = alloca i32, i32 %n
  %square = mul i32 %n, %n
  %all = add i32 %square, %n
  %a = alloca double, i32 %all
  %x = getelementptr double, ptr %a, i32 %square
  %s = alloca double, i32 %n
  %works = mul i32 %n, 8
  %work = alloca double, i32 %works
  %room = alloca i32
  store i32 %works, ptr %room
  br label %test
test:
  %k = phi i32 [ 0, %start ], [ %k.next, %next ]
  %more = icmp slt i32 %k, {lanes}
  br i1 %more, label %lane, label %done
lane:
  %from = getelementptr double, ptr %whole, i32 %k
  %nought = call double @copy(ptr %a, i32 1, ptr %from, i32 {lanes}, i32 {entries})
  store i32 0, ptr %info
{body.replace("LANES", str(lanes))}
  %failed = load i32, ptr %info
  %good = icmp eq i32 %failed, 0
  br i1 %good, label %next, label %lost
lost:
  call double @copy(ptr %x, i32 1, ptr @undefined, i32 0, i32 {to_lane})
  br label %next
next:
  %to = getelementptr double, ptr %from, i32 %place
  call double @copy(ptr %to, i32 {lanes}, ptr %x, i32 1, i32 {to_lane})
  %k.next = add i32 %k, 1
  br label %test
done:
  ret void
}}"""


def link(llvm: Any) -> None:
    """Make the routines known to llvmlite's binding."""
    from scipy.linalg import cython_lapack

    api = ctypes.pythonapi
    api.PyCapsule_GetName.restype, api.PyCapsule_GetName.argtypes = (
        ctypes.c_char_p,
        [ctypes.py_object],
    )
    api.PyCapsule_GetPointer.restype = ctypes.c_void_p
    api.PyCapsule_GetPointer.argtypes = [ctypes.py_object, ctypes.c_char_p]
    for name in ROUTINES:
        capsule = cython_lapack.__pyx_capi__[name]
        llvm.add_symbol(name, api.PyCapsule_GetPointer(capsule, api.PyCapsule_GetName(capsule)))
