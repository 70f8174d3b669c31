"""Motion under loads.

| room          | what                                                                     |
|---------------|--------------------------------------------------------------------------|
| `system`      | what moves: inertia and effort on the drivers, what the loads depend on   |
| `path`        | along the driver's path, without steps in time: ``energy``, ``spectral``  |
| `integration` | in time, with events: ``dop853``, ``lsoda``, ``radau``                     |
| `fixed`       | fixed steps: ``rk4``, ``euler_q``                                         |
| `steady`      | what a motion settles to                                                 |

`simulation` reads a request, `methods` chooses among them, a `motion` comes back.
"""
