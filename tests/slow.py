"""What ``-m "not slow"`` leaves out: most of the time of the suite, by a sample of 880 tests.

Room -> modules that take some two seconds and more. Without modules it is the whole room: other
judges, mutations, searches, the browser. (No mark of single tests gives as much: they take 0.1 s.)
"""

SLOW = {
    "": "calls examples extremes gallery notebooks outside_package pickling samples search "
    "synthesis",
    "analysis": "accuracy equilibria friction_solutions trade trade_budget verify",
    "assur": "rigidity",
    "blocks": "against_the_judge conformance following",
    "cli": "console interrupts main simulate spared_files sweep terminal",
    "couplings": "cam_friction couplings efficiency pressure",
    "draw": "files study",
    "dynamics": "charts compiled damped follow friction_laws honest_estimates impact "
    "loads_in_motion massless_places steady what_acts",
    "engines": "arrays jax",
    "exchange": "c corpus fmu import page report",
    "friction": "enumeration existence law_kernels law_places",
    "fuzz": "",
    "independent": "",
    "joints": "any_document",
    "model": "names",
    "modes": "",
    "mutations": "",
    "proof": "",
    "signals": "friction impacts motions",
    "studies": "batches between identify linearize",
    "studio": "",
}
