"""What ``-m "not slow"`` leaves out: 85 of 100 seconds of the suite, by processor time.

Room -> modules that take some four seconds and more. Without modules it is the whole room: other
judges, mutations, searches, the browser. (No mark of single tests gives as much: they take 0.1 s.)
"""

SLOW = {
    "": "calls examples extremes gallery notebooks outside_package search synthesis",
    "analysis": "accuracy equilibria friction_solutions trade trade_budget verify",
    "blocks": "against_the_judge conformance following",
    "cli": "console interrupts sweep",
    "couplings": "couplings efficiency pressure",
    "draw": "files",
    "dynamics": "charts compiled damped follow friction_laws honest_estimates impact "
    "loads_in_motion massless_places what_acts",
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
    "studies": "batches between linearize",
    "studio": "",
}
