"""Every code that a graph file can cause; each has a file in ``graphs/broken``."""

WORDS = """
    no-file not-a-file no-permission unreadable too-large empty-file wrong-encoding
    truncated syntax too-deep duplicate-key non-finite
    not-an-object wrong-format missing-version bad-version newer-version
    unknown-key missing-key wrong-type wrong-value bad-place bad-direction bad-name
    taken-name unknown-link friction-mismatch clearance-mismatch unknown-friction-law bad-friction
    bad-table bad-expectation wrong-unit
    unknown-block no-frame two-frames bad-address no-such-block not-a-marker
    unknown-marker unknown-joint double-wire self-wire pair-mismatch many-drivers
    wrong-home unwired-joint cycle unknown-driver no-law
    bad-teeth coupling-mismatch coupled-twice coupled-driver coupling-loop
    undercut dead-face open-profile no-room
    no-pose no-graph same-link
    not-a-group unconnected-links over-constrained turning-held-twice too-few-drivers
    too-many-drivers locked-driver conflicting-drivers loose-links
    algebraic-loop no-sensor unknown-output unknown-parameter
"""
FILE_CODES = frozenset(WORDS.split())

LINKAGE_CODES = {
    "unconnected-links": "links that no joint joins to the rest",
    "coincident-joints": "joints at one place, so that they hold nothing, or hold it twice",
    "over-constrained": "links that are held more often than their freedoms are",
    "turning-held-twice": "a loop of sliding joints, which hold the relative turning too often",
    "missing-driver": "more freedoms than drivers",
    "too-many-drivers": "more drivers than freedoms",
    "locked-driver": "a driver whose joint cannot move",
    "conflicting-drivers": "two drivers that prescribe one freedom",
    "conflicting-dimensions": "dimensions of a drawing that cannot hold together",
    "loose-links": "links that move with every driver held",
    "too-tangled": "so many links in loops with each other that only counting is left",
    "no-links": "a document without moving links",
    "does-not-close": "joints that gape, and cannot be closed near the given pose",
    "pose-far-off": "a pose from which another assembly mode may be reached than was meant",
    "dead-centre": "a pose that does not tell the assembly mode",
}
"""What can be wrong with links and joints that are named well."""
