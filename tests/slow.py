"""What ``-m "not slow"`` leaves out: the modules that take most of the processor time.

Room -> its slow modules, measured test by test; what is left of each room is its core. Without
modules it is the whole room: other judges, mutations, searches. (No mark of single tests gives
as much: most take 0.1 s.)
"""

SLOW = {
    "": "calls docs examples extremes gallery notebooks outside_package pickling plan "
    "portable samples search synthesis typing",
    "analysis": "accuracy equilibria extremes_of_outputs friction_solutions trade trade_budget "
    "verify",
    "assur": "rigidity",
    "blocks": "against_the_judge conformance following",
    "cli": "console describe files interrupts main notebook run simulate spared_files sweep "
    "terminal trade",
    "couplings": "cam_friction couplings efficiency pressure",
    "draw": "animation curves diagram files simulation study",
    "dynamics": "charts compiled contact damped follow friction friction_laws friction_states "
    "honest_estimates impact integrators interrupts loads_in_motion massless_places methods roles "
    "steady steady_free sticking stiff stops what_acts",
    "engines": "agreement arrays batches derivatives enclosed jax llvm structure",
    "exchange": "c corpus fmu import page report",
    "friction": "enumeration existence law_kernels law_places self_locking",
    "fuzz": "",
    "independent": "",
    "joints": "any_document",
    "loads": "nature",
    "model": "cycles names",
    "modes": "circuits of_mechanisms search triad_modes",
    "mutations": "",
    "passes": "play",
    "proof": "",
    "signals": "friction impacts motions",
    "studies": "batches between efforts identify linearize motions reductions sensitivity workers",
    "studio": "api browser candidates exports files gestures links live machines motion web",
}
