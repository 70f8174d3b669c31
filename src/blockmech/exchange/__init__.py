"""Files of other programs: `read` makes a linkage of theirs, `write` makes theirs of a mechanism.

Each format is a file of its own, and registers itself by name: a reader in the entry-point group
``blockmech.readers``, a writer in ``blockmech.writers`` (`blockmech.exchange.formats`).
"""

from __future__ import annotations

from blockmech.exchange.formats import write

__all__ = ["write"]
