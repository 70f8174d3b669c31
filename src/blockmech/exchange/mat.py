"""The format ``mat``: the arrays of a run for MATLAB and Octave, version 5.

``x.values.crank_drive`` is a column (n, 1), complex for vectors; ``x.names`` and ``x.units`` say
what each is, ``x.status`` which samples have an answer.
"""

from __future__ import annotations

from typing import IO

import numpy as np

from blockmech.exchange.c.program import Names
from blockmech.exchange.formats import Order, Writer, file_writer

LONGEST = 31  # signs of a field's name in version 5


@file_writer
def write_mat(order: Order, stream: IO[bytes]) -> None:
    """One variable ``run``, a structure."""
    from scipy.io import savemat

    result = order.result()
    names = Names()
    arrays = dict(result.drivers)
    if (time := result._known_time()) is not None:
        arrays["time"] = time
    arrays |= {name: result[name] for name in result}
    fields = {name: names.fresh(name[-LONGEST + 4 :].lstrip("._0123456789")) for name in arrays}
    run = {
        "name": result.mechanism.name,
        "values": {fields[name]: np.asarray(x) for name, x in arrays.items()},
        "names": {fields[name]: name for name in arrays},
        "units": {fields[n]: "s" if n == "time" else result.output(n).unit for n in arrays},
        "status": np.array(result.quality.status, object),
    }
    savemat(stream, {"run": run}, oned_as="column", long_field_names=True)


WRITER = Writer("MATLAB and Octave: the arrays of a run", (".mat",), write_mat)
