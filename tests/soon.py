"""Answers that come soon, judged by processor time: a busy machine does not fail a test."""

import time
from contextlib import contextmanager

SOON = 5.0  # [s] of processor time in which any file or graph is answered


@contextmanager
def answered(within=SOON):
    """What is done inside takes no more processor time [s] than this."""
    start = time.process_time()
    yield
    spent = time.process_time() - start
    assert spent < within, f"{spent:.2f} s of processor time, more than {within:g} s"
