"""A document in an address, behind ``#``: whoever opens it has the sheet, and no server reads it.

What moves it goes with it, so that a page of `blockmech page` shows it without Python.

The text is deflated (RFC 1951) and written in the letters of base 64 that addresses allow (RFC
4648, 5); what stands behind ``#`` is not sent to any server by a browser.
"""

from __future__ import annotations

import base64
import binascii
import json
import zlib
from collections.abc import Iterable
from typing import TYPE_CHECKING

from blockmech.builders import Opened, read_text
from blockmech.exchange.formats import Order
from blockmech.exchange.page.files import Link, contents_of
from blockmech.ground.errors import BlockmechError, refused
from blockmech.ground.runnable import EVERYTHING
from blockmech.model.writing import canonical_text

if TYPE_CHECKING:
    from blockmech.editor.revision import Revision

KEY = "#doc="
MOST = 4 << 20  # bytes of a link that is unpacked


def link_of(now: Revision, names: Iterable[str]) -> Link:
    """A revision, with programs of the named outputs, else of the drives."""
    page, why, text = None, "It is no mechanism yet.", canonical_text(now.form)
    if now.mechanism is not None:
        outputs = tuple(name for name in names if name in now.mechanism.outputs)
        try:
            page = contents_of(Order(now.mechanism, outputs or EVERYTHING))
        except BlockmechError as error:
            why = str(error)
    return Link(text, f"{now.form['name']}.json", page, why)


def packed(link: Link) -> str:
    """A link as what stands behind an address."""
    text = json.dumps(link._asdict(), allow_nan=False)
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
        document = str(json.loads(unpacked_bytes)["document"])
    except (ValueError, LookupError, TypeError, zlib.error, binascii.Error) as error:
        remedy = "copy the whole link again"
        raise refused("link", f"it holds no document: {error}", remedy, code="not-a-link") from None
    return read_text(document, "the link")
