"""Every code that a graph file can cause; each has a file in ``graphs/broken``."""

WORDS = """
    no-file not-a-file no-permission unreadable too-large empty-file wrong-encoding
    truncated syntax too-deep duplicate-key non-finite
    not-an-object wrong-format missing-version bad-version newer-version
    unknown-key missing-key wrong-type wrong-value bad-place bad-direction bad-name
    taken-name unknown-link friction-mismatch bad-table bad-expectation
    unknown-block no-frame two-frames bad-address no-such-block not-a-marker
    unknown-marker unknown-joint double-wire self-wire pair-mismatch many-drivers
    wrong-home unwired-joint cycle unknown-driver
"""
FILE_CODES = frozenset(WORDS.split())
