"""A document in an address, behind ``#``: whoever opens it has the sheet, and no server reads it.

The text is deflated (RFC 1951) and written in the letters of base 64 that addresses allow (RFC
4648, 5); what stands behind ``#`` is not sent to any server by a browser.
"""

from __future__ import annotations

import base64
import binascii
import zlib

from blockmech.builders import Opened, read_text
from blockmech.ground.errors import refused

KEY = "#doc="
MOST = 4 << 20  # bytes of a document that is unpacked


def packed(text: str) -> str:
    """A document as what stands behind an address."""
    maker = zlib.compressobj(9, zlib.DEFLATED, -zlib.MAX_WBITS)
    data = maker.compress(text.encode()) + maker.flush()
    return KEY + base64.urlsafe_b64encode(data).decode().rstrip("=")


def unpacked(fragment: str) -> Opened:
    """The document behind an address.

    Raises `RequestError` for what is none, or too large, and what reading a file raises.
    """
    text = fragment.removeprefix(KEY)
    try:
        data = base64.b64decode(text + "=" * (-len(text) % 4), b"-_", validate=True)
        maker = zlib.decompressobj(-zlib.MAX_WBITS)
        unpacked_bytes = maker.decompress(data, MOST)
        if maker.unconsumed_tail or not maker.eof:
            raise ValueError("it is cut, or larger than a document may be")
        document = unpacked_bytes.decode()
    except (ValueError, zlib.error, binascii.Error) as error:
        remedy = "copy the whole link again"
        raise refused("link", f"it holds no document: {error}", remedy, code="not-a-link") from None
    return read_text(document, "the link")
